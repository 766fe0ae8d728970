"""track: noise and coefficients sample by sample."""
import csv
import pathlib
import random
import resource
import tempfile
import unittest

from program import LANE_CHANGE, ROOT, SYSTEM_1, result, run


class Track(unittest.TestCase):
    """System 1 with Q = 1, from sample 300 on 10."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        path = pathlib.Path(self.folder.name)
        self.model = path / "model.yaml"
        self.model.write_text(SYSTEM_1)
        chance = random.Random(4)
        x, rows = 0.0, []
        for t in range(900):
            rows.append(x + chance.gauss(0, 1))
            x = 0.5 * x + chance.gauss(0, 1 if t < 300 else 10**0.5)
        self.data = path / "data.csv"
        self.data.write_text("y\n" + "".join(f"{y:.9g}\n" for y in rows))

    def warnings_of(self, rows, *extra):
        self.data.write_text("y\n" + "".join(f"{y}\n" for y in rows))
        begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        out = result("track", self.model, self.data, *extra, code=1)
        self.assertLess(resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - begin, 10)
        return {w["code"]: w for w in out["warnings"]}

    def test_a_mistake_of_the_sensor_does_not_take_for_ever(self):
        """The draws of the noise would have to move by a factor of 1e24, stage by stage."""
        rows = self.data.read_text().split()[1:150]
        rows[70] = "1e12"
        self.model.write_text(SYSTEM_1.replace("A: [[0.5]]", "A: [[1]]").replace("R: {", "initial: diffuse\nR: {"))
        for extra in ([], ["--adaptive"]):
            self.assertIn("could not follow", self.warnings_of(rows, *extra)["draws_left_behind"]["text"])

    def test_three_rows_are_too_few(self):
        self.assertEqual("serious", self.warnings_of(["1.5", "-0.7", "2"])["few_samples"]["severity"])

    def test_a_change_is_found_and_written(self):
        folder = pathlib.Path(self.folder.name) / "out"
        out = result("track", self.model, self.data, "--adaptive", "-o", folder)
        self.assertEqual(len(out["time_history"]["changes"]), 1)
        change = out["time_history"]["changes"][0]
        self.assertLess(abs(change["since"] - 300), 30)
        self.assertLess(change["found"], 400)
        self.assertLess(abs(out["parameters"][0]["value"] - 10), 4 * out["parameters"][0]["se"])
        with (folder / "course.csv").open() as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 900)
        self.assertEqual(rows[100]["Q(1,1)_sd"], "")
        self.assertGreater(float(rows[899]["Q(1,1)_sd"]), 0)
        self.assertIn("change at", run("track", self.model, self.data, "--adaptive", code=0).stdout)

    def test_constant_noise_is_the_posterior_of_all(self):
        out = result("track", self.model, self.data)
        batch = result("tune", self.model, self.data, "--method", "bayes")
        for ours, theirs in zip(out["parameters"], batch["parameters"]):
            self.assertLess(abs(ours["value"] - theirs["value"]), 0.3 * theirs["se"])

    def test_what_it_cannot_do(self):
        model = pathlib.Path(self.folder.name) / "free.yaml"
        model.write_text(SYSTEM_1.replace("A: [[0.5]]", "parameters: {a: {value: 0.5, min: 0, max: 0.9}}\nA: [[a]]"))
        error = run("track", model, self.data, code=2).stderr
        self.assertIn("'a' is free and is not noise", error)


REGRESSION = """identikal: 1
name: yaw rate from steering
model: regression
time: {column: t, unit: s}
inputs: {steer: {column: swa, unit: deg}}
outputs: {r: {column: yaw_rate, unit: deg/s}}
regression: {inputs: 1, feedback: 1, forgetting: 0.999, delta: 0.01}
"""


class TrackRegression(unittest.TestCase):
    """r(t) = g steer(t) + 0.8 r(t-1) + noise of sd 0.1; g = 0.05, from 60 s on 0.1."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        chance = random.Random(5)
        r, self.rows = 0.0, []
        for k in range(1200):
            steer = chance.gauss(0, 20)
            r = (0.05 if k < 600 else 0.1) * steer + 0.8 * r + chance.gauss(0, 0.1)
            self.rows.append([f"{0.1 * k:.1f}", f"{steer:.9g}", f"{r:.9g}"])

    def write(self, text=REGRESSION, rows=None):
        model, data = self.path / "model.yaml", self.path / "data.csv"
        model.write_text(text)
        data.write_text("t,swa,yaw_rate\n" + "".join(",".join(row) + "\n" for row in rows or self.rows))
        return model, data

    def test_coefficients_and_their_course(self):
        folder = self.path / "out"
        out = result("track", *self.write(rows=self.rows[:600]), "-o", folder)
        steer, before = out["parameters"]
        self.assertEqual((steer["name"], steer["unit"], before["name"]), ("steer(t)", "(deg/s)/deg", "r(t-1)"))
        self.assertLess(abs(steer["value"] - 0.05), 4 * steer["se"])
        self.assertLess(abs(before["value"] - 0.8), 4 * before["se"])
        self.assertEqual(list(out["fit"]["one_step"]), ["r"])
        with (folder / "course.csv").open() as file:
            rows = list(csv.DictReader(file))
        self.assertEqual(len(rows), 600)
        self.assertEqual(rows[0]["r(t-1)"], "")
        self.assertAlmostEqual(float(rows[-1]["r(t-1)"]), before["value"], 6)

    def test_what_is_left_open_is_chosen(self):
        model, data = self.write(REGRESSION.split("regression: {")[0], self.rows[:600])
        out = result("track", model, data)
        self.assertEqual([p["name"] for p in out["parameters"]], ["steer(t)", "r(t-1)"])
        derived = {d["name"]: d["value"] for d in out["derived"]}
        self.assertEqual((derived["inputs"], derived["feedback"], derived["forgetting"]), (1, 1, 1))
        auto = self.write(REGRESSION.replace("0.999", "auto").replace("0.01", "auto"), self.rows)
        self.assertLess({d["name"]: d["value"] for d in result("track", *auto)["derived"]}["forgetting"], 1)

    def test_a_change_is_found(self):
        for text in (REGRESSION.replace("0.01", "0.01, reset: true"),
                     REGRESSION.replace("0.999", "variable, memory: 200")):
            out = result("track", *self.write(text))
            self.assertLess(abs(out["time_history"]["changes"][0]["since"] - 60), 2)
            self.assertLess(abs(out["time_history"]["changes"][0]["found"] - 60), 3)
            self.assertLess(abs(out["parameters"][0]["value"] - 0.1), 0.005)
        self.assertIn("change at", run("track", *self.write(text), code=0).stdout)

    def test_missing_samples_are_left_out(self):
        rows = [row[:] for row in self.rows[:600]]
        rows[100][2] = rows[101][2] = rows[300][1] = ""
        del rows[400:410]
        out = run("track", *self.write(rows=rows), code=0).stdout
        # Outputs 100 and 101 cost three rows, the input one, the gap of ten eleven.
        self.assertIn("15 samples left out", " ".join(out.split()))

    def test_bad_models(self):
        for text, words in (
                (REGRESSION.replace("feedback", "fedback"), (":7:", "did you mean 'feedback'")),
                (REGRESSION.replace("0.999", "1.2"), (":7:", "above 0 and at most 1")),
                (REGRESSION.replace("0.999", "0"), (":7:", "above 0 and at most 1")),
                (REGRESSION.replace("delta: 0.01", "delta: -1"), (":7:", "delta is '-1'")),
                (REGRESSION.replace("inputs: 1", "inputs: 0"), (":7:", "whole number from 1")),
                (REGRESSION.replace("delta: 0.01", "memory: 50"), (":7:", "forgetting: variable")),
                (REGRESSION.replace("inputs: {steer: {column: swa, unit: deg}}\n", ""), ("inputs",)),
                (REGRESSION.replace("deg/s}}", "deg/s}, b: {column: swa}}"), (":6:", "one")),
                (REGRESSION.replace("name: yaw", "parameters: {a: 1}\nname: yaw"), (":2:", "does not belong")),
                (REGRESSION + "A: [[1]]\n", (":8:", "does not belong to model: regression")),
                (SYSTEM_1 + "regression: {inputs: 1}\n", ("belongs to model: regression",))):
            error = run("track", *self.write(text), code=2).stderr
            for word in words:
                self.assertIn(word, error)
            self.assertEqual(error.count("\n"), 1, error)

    def test_bad_recordings_and_other_verbs(self):
        self.assertIn("complete rows for", run("track", *self.write(rows=self.rows[:8]), code=2).stderr)
        empty = [[t, steer, ""] for t, steer, _ in self.rows]
        self.assertIn("yaw_rate", run("track", *self.write(rows=empty), code=2).stderr)
        files = self.write()
        for verb in ("tune", "check", "shape", "bound"):
            self.assertIn("track MODEL DATA", run(verb, *files, code=2).stderr)
        self.assertIn("--adaptive", run("track", *files, "--adaptive", code=2).stderr)
        self.assertIn("steer", run("info", *files, code=0).stdout)

    def test_the_example(self):
        out = result("track", ROOT / "examples/yaw_rate_regression.yaml", LANE_CHANGE[1])
        # One coefficient of the past alone nearly repeats the output.
        self.assertGreater(out["fit"]["one_step"]["r"]["fit_percent"], 80)

    def test_all_samples_at_once(self):
        out = result("fit", ROOT / "examples/yaw_rate_regression.yaml", LANE_CHANGE[1])
        self.assertEqual(out["objective"]["method"], "least squares")
        self.assertEqual([p["name"] for p in out["parameters"]], ["steer(t)", "r(t-1)"])
        self.assertIsNone(out["time_history"])
        for option in (["--method", "trajectory"], ["--hold-out", "30%"], ["--objective", "simulation"]):
            error = run("fit", ROOT / "examples/yaw_rate_regression.yaml", LANE_CHANGE[1], *option, code=2).stderr
            self.assertIn("does not apply to a regression", error)

    def test_a_vehicle(self):
        out = run("track", *LANE_CHANGE, code=0).stdout
        self.assertIn("identikal fit", out)
        out = result("track", *LANE_CHANGE)
        tracked = [p for p in out["parameters"] if not p["fixed"]]
        self.assertEqual([p["name"] for p in tracked], out["time_history"]["names"])
        for p in tracked:
            truth = 88107.7 if p["name"] != "Iz" else 2319
            self.assertLess(abs(p["value"] / truth - 1), 0.1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
