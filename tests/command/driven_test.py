"""Filters whose model is driven by an input."""
import json
import math
import pathlib
import random
import re
import unittest

from program import Folder, result, run


class Driven(unittest.TestCase):
    """A level that pulls back to zero and is driven by an input, as the model says or seven samples later."""

    MODEL = """identikal: 1
time: {column: t, unit: s, step: 0.1 s}
parameters: {b: {value: 1}, q: {value: 1, min: 0}, r: {value: 1, min: 0}}
A: [[0.9]]
B: [[b]]
C: [[1]]
Q: [[q]]
R: [[r]]
initial: stationary
inputs: {u: {column: u, unit: m}}
outputs: {y: {column: y, unit: m}}
"""

    def setUp(self):
        self.folder = Folder().__enter__()
        self.out = self.folder.path / "out"
        self.model = self.folder.write("m.yaml", self.MODEL)

    def tearDown(self):
        self.folder.__exit__()

    def recording(self, name, seed, delay=0, rows=600, absent=(), feedback=0.0):
        draw = random.Random(seed)
        x, u, lines = 0.0, [], []
        for t in range(rows):
            y = x + draw.gauss(0, 1)
            u.append(draw.gauss(0, 1) - feedback * y)
            if t not in absent:
                lines.append(f"{0.1 * t:.1f},{u[t]:.6f},{y:.6f}")
            x = 0.9 * x + (u[t - delay] if t >= delay else 0.0) + draw.gauss(0, 0.5)
        return self.folder.write(name, "\n".join(["t,u,y", *lines]) + "\n")

    def test_innovations_that_follow_an_input_are_named(self):
        right, late = self.recording("right.csv", 1), self.recording("late.csv", 2, delay=7)
        for data, expected in ((right, True), (self.recording("loop.csv", 3, feedback=0.3), True), (late, False)):
            out = result("tune", self.model, data, "--starts", 1, "-o", self.out, code=0 if expected else 1)
            test = next(t for t in out["tests"] if t["id"] == "input_correlation")
            self.assertEqual(expected, test["pass"], data)
            self.assertEqual(expected, "input_in_innovations" not in [w["code"] for w in out["warnings"]])
            self.assertAlmostEqual(0.05 / 3, 1 - self.f_share(test), delta=4e-3)
        run("tune", self.model, right, "-o", self.out)
        self.assertEqual("ok", result("validate", self.out, self.recording("more.csv", 4))["status"]["code"])
        out = result("validate", self.out, late, code=1)
        self.assertIn("input_correlation", out["status"]["message"])

    @staticmethod
    def f_share(test):
        """Of F with many degrees of freedom below the test's limit: chi-square over 10, an Erlang distribution."""
        half = 5 * test["interval"][1]
        return 1 - math.exp(-half) * sum(half**i / math.factorial(i) for i in range(5))

    def test_rows_that_are_absent_are_not_counted(self):
        model = self.folder.write("quiet.yaml", re.sub("b: .value: 1., ", "", self.MODEL).replace("B: [[b]]\n", "").replace("inputs: {u: {column: u, unit: m}}\n", ""))
        data = self.recording("gap.csv", 5, absent=range(50, 58))
        text = run("tune", model, data, "--starts", 1, "-o", self.out).stdout
        self.assertIn("592 rows, 592 used", text)
        self.assertEqual((592, 592), tuple(json.loads((self.out / "result.json").read_text())["inputs"][0][k] for k in ("rows", "used")))
        sheet = json.loads((self.out / "report_data.json").read_text())["recordings"][0]
        self.assertEqual((592, 1, 0), (sheet["rows"], sheet["gap_count"], sheet["channels"][0]["missing"]))
        self.assertAlmostEqual(0.9, sheet["longest_step"])
        self.assertIn("592 of 592 rows used", run("export", self.out, "--to", "c", code=0).stdout)

    def test_exports_say_what_was_done_to_columns_and_name_states(self):
        model = self.folder.write("turned.yaml", self.MODEL.replace("u: {column: u, unit: m}", "u: {column: u, unit: m, scale: -1}"))
        run("tune", model, self.recording("right.csv", 1), "--starts", 1, "-o", self.out)
        for language in ("cpp", "python", "yaml"):
            self.assertIn("recorded: u is column 'u' times -1", run("export", self.out, "--to", language, code=0).stdout)
        self.assertIn("u is column 'u' times -1", [w["text"] for w in json.loads(run("export", self.out, "--to", "json", code=0).stdout)["warnings"]])

    def test_compare_ranks_held_out_rows_by_their_likelihood(self):
        data, names = self.recording("right.csv", 1), []
        known = self.folder.write("known.yaml", self.MODEL.replace("b: {value: 1}", "b: 1"))
        for name, model in (("free", self.model), ("known", known)):
            names.append(self.folder.path / name)
            run("tune", model, data, "--hold-out", "30%", "--starts", 1, "-o", names[-1])
        out = result("compare", *names)
        held = {t["channel"]: t["value"] for t in out["tests"] if t["id"] == "held_out"}
        for name in names:
            stored = json.loads((name / "result.json").read_text())
            self.assertEqual(stored["objective"]["held_out"], held[str(name)])
            self.assertAlmostEqual(stored["objective"]["held_out"], {d["name"].strip(): d["value"] for d in stored["derived"]}["on held-out rows"])

    def test_no_input_is_written_over(self):
        data = self.recording("right.csv", 1)
        before = pathlib.Path(data).read_bytes()
        run("tune", self.model, data, "--starts", 1, "-o", self.out)
        for arguments in (("tune", self.model, data, "--starts", 1, "--report", data), ("export", self.out, "--to", "c", "-o", data),
                          ("tune", self.model, data, "--starts", 1, "--report", self.model)):
            self.assertIn("would be written over, and this job reads it; expected another place with", run(*arguments, code=2).stderr)
            self.assertEqual(before, pathlib.Path(data).read_bytes())
            self.assertEqual(self.MODEL, pathlib.Path(self.model).read_text())

    def test_nothing_that_a_job_rests_on_is_written_over(self):
        data, held_out = self.recording("right.csv", 1), self.recording("other.csv", 2)
        model = self.folder.write("outer.yaml", "identikal: 1\ninclude: " + pathlib.Path(self.model).name + "\n")
        run("tune", model, data, "--starts", 1, "-o", self.out)
        kept = [pathlib.Path(f) for f in (data, held_out, model, self.model, self.out / "result.json", self.out / "report_data.json")]
        before = [f.read_bytes() for f in kept]
        tune = ("tune", model, data, "--starts", 1)
        for arguments in (("report", self.out, "--report", self.out / "result.json"), ("report", self.out, "--report", self.out / "report_data.json"),
                          ("report", self.out, "--report", data), ("report", self.out, "--report", model), ("report", self.out, "--report", self.model),
                          ("export", self.out, "--to", "cpp", "-o", self.out / "report_data.json"),
                          ("filter", model, data, "--from", self.out, "-o", self.out), ("validate", self.out, held_out, "-o", self.out),
                          (*tune, "--hold-out", held_out, "--report", held_out), (*tune, "--report", self.model),
                          ("simulate", self.model, self.folder.write("simulated.csv", pathlib.Path(data).read_text()), "-o", self.folder.path)):
            with self.subTest(arguments):
                self.assertIn("would be written over, and this job reads it; expected another place with", run(*arguments, code=2).stderr)
                self.assertEqual(before, [f.read_bytes() for f in kept])

    def test_two_outputs_are_not_one_file(self):
        data, out = self.recording("right.csv", 1), self.folder.path / "both"
        for page in (out / "result.json", out / ".." / "both" / "residuals.csv"):
            done = run("tune", self.model, data, "--starts", 1, "-o", out, "--report", page, code=2)
            self.assertIn("--report and -o would both be written to it; expected another place with --report", done.stderr)
            self.assertFalse(out.exists())

    def test_an_empty_file_beside_a_result_is_said(self):
        run("tune", self.model, self.recording("right.csv", 1), "--starts", 1, "-o", self.out)
        (self.out / "report_data.json").write_text("")
        self.assertIn("report_data.json: is empty", run("report", self.out, code=2).stderr)
        self.assertFalse((self.out / "report.html").exists())

    def test_values_of_another_model_are_said(self):
        data = self.recording("right.csv", 1)
        run("tune", self.model, data, "--starts", 1, "-o", self.out, code=0)
        codes = lambda model: [w["code"] for w in result("filter", model, data, "--from", self.out)["warnings"]]
        self.assertNotIn("model_changed", codes(self.model))
        other = self.folder.write("other.yaml", self.MODEL.replace("0.9", "0.5"))
        self.assertIn("model_changed", codes(other))
        done = run("filter", other, data, "--from", self.out, code=0)
        self.assertIn("identikal: warning: the values of", done.stderr)

    def test_too_few_rows_to_validate_are_said(self):
        run("tune", self.model, self.recording("right.csv", 1), "--starts", 1, "-o", self.out, code=0)
        blind = lambda data: [w["text"] for w in json.loads(run("validate", self.out, data, "--json").stdout)["warnings"] if w["code"] == "insufficient_power"]
        self.assertEqual([], blind(self.recording("more.csv", 6)))
        self.assertIn("would not show innovations", blind(self.recording("few.csv", 7, rows=6))[0])

    def test_a_filter_at_rest_within_a_drive_is_said(self):
        data = self.recording("right.csv", 1)
        said = lambda *more: [w["code"] for w in json.loads(run("check", self.model, data, *more, "--json").stdout)["warnings"]]
        self.assertIn("goes_on", said("--range", "20:50"))
        self.assertIn("starts_within", said(self.recording("other.csv", 6), "--range", "20:50"))
        self.assertNotIn("starts_within", said())



class Curve(unittest.TestCase):
    """A lag driven through a valve that nobody knows: b u^2, found as a spline of five knots."""

    MODEL = """identikal: 1
states: {level: cm}
inputs: [{name: command, unit: V}]
parameters: {tau: {value: 3 s, min: 0.1 s}, s: {value: 0.2 cm, min: 0 cm}}
time: {kind: continuous, step: 0.5 s}
let: {flow: {spline: command, knots: [0 V, 1 V, 2 V, 3 V, 4 V], unit: cm/s, values: [0, 1, 2, 3, 4]}}
dynamics: {level: flow - level/tau}
outputs: {gauge: {column: gauge, unit: cm, equals: level}}
noise: {measurement: {sd: {gauge: s}}}
initial: {mean: {level: 0}}
"""

    def test_it_is_found_and_goes_on_in_every_form(self):
        draw, level, lines = random.Random(4), 0.0, ["command,gauge"]
        for t in range(500):
            command = 2 + 1.2 * math.sin(0.3 * t) + 0.8 * math.sin(1.7 * t)
            lines.append(f"{command:.9f},{level + draw.gauss(0, 0.1):.9f}")
            level = math.exp(-0.5 / 3) * level + 3 * (1 - math.exp(-0.5 / 3)) * 0.2 * command ** 2
        with Folder() as made:
            model, data = made.write("valve.yaml", self.MODEL), made.write("valve.csv", "\n".join(lines) + "\n")
            found = result("fit", model, data, "-o", made.path / "out")
            of = {each["name"]: each for each in found["parameters"]}
            for knot, truth in enumerate((0.0, 0.2, 0.8, 1.8, 3.2), 1):
                each = of[f"flow_{knot}"]
                self.assertEqual("cm/s", each["unit"])
                self.assertLess(abs(each["value"] - truth), 4.5 * each["se"], each)
            tuned = made.write("tuned.yaml", run("export", made.path / "out", "--to", "yaml", code=0).stdout)
            again = {each["name"]: each for each in result("fit", tuned, data)["parameters"]}
            self.assertAlmostEqual(of["flow_3"]["value"], again["flow_3"]["value"], places=5)
            bound = run("bound", tuned, "--rows", 500, "--input", "command=2+1.2*sin(0.6*t)+0.8*sin(3.4*t)", code=0)
            self.assertIn("flow_3", bound.stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
