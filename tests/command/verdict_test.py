"""Verdicts on noise: what is said of it, whatever the units, and what is done with a result that is not to be trusted."""
import pathlib
import random
import unittest

from program import SYSTEM_1, Folder, result, run

HEATER = """identikal: 1
name: heater
time: {{kind: continuous, step: 60 s, inputs: zoh}}
parameters:
  Ta: {{value: {start} {unit}, min: {low} {unit}, max: {high} {unit}}}
  tau: 1500 s
  k: 0.02 K/W
  q: {{value: 1e-4 K^2/s, min: 0}}
  r: {{value: 0.04 K^2, min: 0}}
states: {{T: {unit}}}
inputs: {{P: {{column: P, unit: W}}}}
dynamics:
  T: (Ta - T)/tau + k/tau*P
outputs: {{T: {{column: temp, unit: {unit}}}}}
noise:
  process: {{kind: density, variance: {{T: q}}}}
  measurement: {{variance: {{T: r}}}}
initial: {{mean: {{T: {mean} {unit}}}, sd: {{T: 3 K}}}}
"""
AR = """identikal: 1
time: {kind: discrete, step: 1 s}
parameters: {a: {value: 0.5, min: -0.999, max: 0.999}, q: {value: 1, min: 0}, r: {value: 1, min: 0}}
A: [[a]]
C: [[1]]
Q: [[q]]
R: [[r]]
initial: stationary
outputs: [{name: y}]
"""


class Verdict(unittest.TestCase):
    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__, None, None, None)
        self.model = self.folder.write("model.yaml", SYSTEM_1)

    def system_1(self, rows, outliers=(), seed=3):
        draw = random.Random(seed)
        x, y = 0.0, []
        for _ in range(rows):
            y.append(x + draw.gauss(0, 1))
            x = 0.5 * x + draw.gauss(0, 3)
        for t, by in outliers:
            y[t] += by
        return self.folder.write("data.csv", "y\n" + "".join(f"{v:.9g}\n" for v in y))

    def codes(self, out):
        return {w["code"]: w["severity"] for w in out["warnings"]}

    def test_a_temperature_is_the_same_in_kelvin_and_in_degrees(self):
        draw = random.Random(5)
        T, rows = 20.0, []
        for t in range(600):
            P = 400.0 if t % 100 < 40 else 0.0
            rows.append((T + draw.gauss(0, 0.2), P))
            T += 60 / 1500 * (21.5 - T + 0.02 * P) + draw.gauss(0, 0.08)
        found = {}
        for unit, zero in (("degC", 0.0), ("K", 273.15)):
            data = self.folder.write(f"{unit}.csv", "temp,P\n" + "".join(f"{y + zero:.9f},{P:g}\n" for y, P in rows))
            model = self.folder.write(f"{unit}.yaml", HEATER.format(unit=unit, start=18 + zero, low=zero, high=40 + zero, mean=20 + zero))
            out = result("tune", model, data, "--starts", 1)
            p = out["parameters"][0]
            found[unit] = [v - zero for v in (p["value"], *p["ci95"], *p["profile95"])]
            self.assertEqual(p["verdict"], "ok")
        for celsius, kelvin in zip(found["degC"], found["K"], strict=True):
            self.assertAlmostEqual(celsius, kelvin, delta=1e-5)
        self.assertLess(found["degC"][3], 21.5)
        self.assertGreater(found["degC"][4], 21.5)

    def test_outliers_are_judged_by_what_they_do(self):
        one = result("tune", self.model, self.system_1(3000, [(1000, 25)]), "--starts", 1)
        self.assertEqual("warning", self.codes(one)["outliers"])
        many = result("tune", self.model, self.system_1(3000, [(t, 30) for t in range(100, 3000, 300)]), "--starts", 1, code=1)
        self.assertEqual("serious", self.codes(many)["outliers"])
        text = next(w["text"] for w in many["warnings"] if w["code"] == "outliers")
        self.assertIn("without them R(1,1) is", text)
        cleaned = result("tune", self.model, self.folder.path / "data.csv", "--starts", 1, "--reject-outliers")
        self.assertIn(f"without them R(1,1) is {cleaned['parameters'][1]['value']:.4g} instead of {many['parameters'][1]['value']:.4g}", text)

    def test_rare_large_noise_is_said(self):
        draw = random.Random(1)
        data = self.system_1(3000, [(t, draw.choice((-1, 1)) * 13) for t in range(0, 3000) if draw.random() < 0.02])
        out = result("tune", self.model, data, "--starts", 1, code=1)
        self.assertIn("heavy_tails", self.codes(out))
        self.assertEqual({"untrusted"}, {p["verdict"] for p in out["parameters"] if not p["fixed"]})

    def test_what_is_not_to_be_trusted_is_not_exported_by_accident(self):
        data = self.system_1(2000, [(t, 60) for t in range(50, 2000, 100)])
        tuned = self.folder.path / "tuned"
        run("tune", self.model, data, "-o", tuned, code=1)
        refused = run("export", tuned, "--to", "python", code=2).stderr
        self.assertIn("the result is 'untrusted'", refused)
        self.assertIn("--force exports it all the same", refused)
        self.assertIn("NOT TO BE TRUSTED", run("export", tuned, "--to", "python", "--force", code=0).stdout)

    def test_a_step_that_time_stamps_contradict(self):
        y = pathlib.Path(self.system_1(400)).read_text().splitlines()[1:]
        data = self.folder.write("stamped.csv", "t,y\n" + "".join(f"{2 * t},{v}\n" for t, v in enumerate(y)))
        out = result("tune", self.model, data, "--starts", 1, code=1)
        self.assertEqual("serious", self.codes(out)["step_differs"])

    def test_a_start_that_stopped_on_a_plateau_is_no_other_maximum(self):
        model = self.folder.write("ar.yaml", AR)
        data = self.folder.write("ar.csv", run("simulate", model, "--set", "a=0.8", "-n", 500, code=0).stdout)
        out = result("tune", model, data)
        self.assertLess(out["objective"]["starts_at_optimum"], out["objective"]["starts"])
        self.assertEqual("note", self.codes(out)["several_maxima"])

    def test_a_ramp_is_no_colour(self):
        data = self.folder.write("ramp.csv", "y1\n" + "".join(f"{t}\n" for t in range(200)))
        model = self.folder.write("level.yaml", "identikal: 1\ntime: {step: 1 s}\nA: [[1]]\nC: [[1]]\nQ: {structure: diagonal, start: 1}\n"
                                  "R: {structure: diagonal, start: 1}\ninitial: diffuse\noutputs: [{name: y1}]\n")
        out = result("shape", model, data, code=1)
        self.assertIn("are constant: that is a drift", out["status"]["message"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
