"""Parameters with values of their own in each recording; static models; errors of regression."""
import math
import random
import re
import unittest

from program import Folder, result, run

COOLING = """identikal: 1
name: cooling
time: {kind: continuous, step: 20 s}
parameters:
  k: {value: 2e-3 1/s, min: 0}
  T0: {value: 60, per: recording}
  room: 20
  s: {value: 1, min: 0}
states: [T]
dynamics: {T: -k*(T - room)}
outputs: {y: {column: T, equals: T}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {T: T0}}
recordings:
  window: {room: 12}
"""

CURVE = """identikal: 1
model: static
parameters:
  a: {value: 1}
  b: {value: 1}
  s: {value: 1, min: 0}
inputs: {x: {column: x}}
outputs: {y: {column: y, equals: a + b*x}}
noise: {measurement: {sd: {y: s}}}
"""


def cup(start, room, seed, rows=60):
    draw = random.Random(seed)
    return "T\n" + "".join(f"{room + (start - room) * math.exp(-0.02 * t) + 0.5 * draw.gauss(0, 1):.6f}\n" for t in range(rows))


def values(found):
    return {p["name"]: p["value"] for p in found["parameters"]}


class OwnParameters(unittest.TestCase):
    def fitted(self, made, *more):
        model = made.write("cooling.yaml", COOLING)
        kitchen, window = made.write("kitchen.csv", cup(80, 20, 1)), made.write("window.csv", cup(70, 12, 2))
        return model, kitchen, window, result("fit", model, kitchen, window, *more)

    def test_what_is_shared_and_what_is_not(self):
        with Folder() as made:
            found = self.fitted(made)[-1]
            self.assertEqual("ok", found["status"]["code"], found["status"])
            got = values(found)
            self.assertEqual({"k", "s", "T0_kitchen", "T0_window", "room", "room_window"}, set(got))
            for name, truth in {"k": 1e-3, "T0_kitchen": 80, "T0_window": 70, "room": 20, "room_window": 12}.items():
                self.assertAlmostEqual(got[name], truth, delta=0.02 * truth, msg=name)

    def test_a_result_serves_the_recordings_that_it_knows(self):
        with Folder() as made:
            model, kitchen, window, _ = self.fitted(made, "-o", made.path / "cups")
            rows = run("filter", model, window, "--from", made.path / "cups").stdout.strip().split("\n")
            self.assertEqual(len(rows), 61)
            self.assertAlmostEqual(float(rows[1].split(",")[1]), 70, delta=1)
            other = made.write("other.csv", cup(75, 20, 3))
            refused = run("filter", model, other, "--from", made.path / "cups")
            self.assertEqual(refused.returncode, 2)
            self.assertIn("no value of 'T0' is known for this recording", refused.stderr)
            named = run("filter", model, other, "--from", made.path / "cups", "--set", "T0_other=75")
            self.assertEqual(named.returncode, 0, named.stderr)

    def test_what_would_take_the_start_for_the_value_is_refused(self):
        with Folder() as made:
            model, kitchen, _, _ = self.fitted(made, "-o", made.path / "cups")
            refused = run("export", made.path / "cups", "--to", "python", code=2)
            self.assertIn("values of their own in each recording", refused.stderr)
            other = made.write("other.csv", cup(75, 20, 3))
            for arguments in (("validate", made.path / "cups", other), ("forecast", model, other, "-n", "3", "--from", made.path / "cups")):
                refused = run(*arguments, code=2)
                self.assertIn("no value of 'T0' is known for this recording", refused.stderr)
            kept = run("export", made.path / "cups", "--to", "yaml", code=0).stdout
            self.assertIn("per: recording", kept)

    def test_a_recordings_numbers_serve_forecast_bound_and_validate(self):
        with Folder() as made:
            model, kitchen, window, found = self.fitted(made, "-o", made.path / "cups")
            got = values(found)
            # The same as a model whose numbers are those of this recording.
            alone = COOLING.replace(", per: recording", "").replace("recordings:\n  window: {room: 12}\n", "")
            for name, value in {"T0": got["T0_window"], "room": 12, "k": got["k"], "s": got["s"]}.items():
                alone = re.sub(rf"  {name}: .*", f"  {name}: {{value: {value!r}, min: 0}}", alone)
            written = made.write("alone.yaml", alone)
            joint = run("forecast", model, window, "-n", "5", "--from", made.path / "cups", code=0).stdout
            single = run("forecast", written, window, "-n", "5", code=0).stdout
            for one, other in zip(joint.split("\n")[1:-1], single.split("\n")[1:-1]):
                for a, b in zip(one.split(","), other.split(",")):
                    self.assertAlmostEqual(float(a), float(b), delta=1e-6 * abs(float(b)))
            checked = result("validate", made.path / "cups", kitchen, window)
            self.assertEqual("ok", checked["status"]["code"], checked["status"])
            self.assertAlmostEqual(checked["objective"]["log_likelihood"], found["objective"]["log_likelihood"], delta=1e-3)

    def test_hold_out_of_the_same_recordings(self):
        with Folder() as made:
            found = self.fitted(made, "--hold-out", "30%")[-1]
            self.assertTrue(math.isfinite(found["objective"]["held_out"]), found["objective"])

    def test_one_value_for_each_label(self):
        with Folder() as made:
            text = COOLING.replace("per: recording", "per: pot").replace("  window: {room: 12}\n", "  a: {pot: red}\n  b: {pot: red}\n  c: {pot: blue, room: 12}\n")
            model = made.write("pots.yaml", text)
            files = [made.write(f"{name}.csv", cup(start, room, seed)) for name, start, room, seed in (("a", 80, 20, 1), ("b", 80, 20, 2), ("c", 60, 12, 3))]
            got = values(result("fit", model, *files))
            self.assertAlmostEqual(got["T0_red"], 80, delta=0.5)
            self.assertAlmostEqual(got["T0_blue"], 60, delta=0.5)
            without = run("fit", model, made.write("d.csv", cup(80, 20, 1)))
            self.assertEqual(without.returncode, 2)
            self.assertIn("recording 'd.csv' has no pot", without.stderr)

    def test_mistakes_are_named(self):
        wrong = {
            "rom: 12": "'rom'; expected parameters; did you mean 'room'?",
            "room: rom": "'room' of recording 'window' is 'rom'",
            "room: room": "is itself",
            "k: room": "which is in no unit",
            "room: 12 kg": "kg",
            "k: -1": "min",
        }
        with Folder() as made:
            data = made.write("window.csv", cup(70, 12, 2))
            for row, message in wrong.items():
                refused = run("fit", made.write("cooling.yaml", COOLING.replace("room: 12", row)), data)
                self.assertEqual(refused.returncode, 2, row)
                self.assertEqual(refused.stderr.count("\n"), 1, refused.stderr)
                self.assertIn(message, refused.stderr, row)
            model = made.write("cooling.yaml", COOLING)
            for arguments in (("bound", model, "-n", "10"), ("fit", model, data, "--objective", "simulation"),
                              ("tune", model, data, "--extend"), ("tune", model, data, "--noise", "student")):
                refused = run(*arguments)
                self.assertEqual(refused.returncode, 2, arguments)
                self.assertEqual(refused.stderr.count("\n"), 1, refused.stderr)


class Static(unittest.TestCase):
    def test_errors_are_those_of_regression(self):
        x, y = [0, 1, 2, 3], [1.1, 1.9, 3.2, 3.8]
        mean = sum(x) / 4
        slope = sum((a - mean) * b for a, b in zip(x, y)) / sum((a - mean) ** 2 for a in x)
        start = sum(y) / 4 - slope * mean
        left = sum((b - start - slope * a) ** 2 for a, b in zip(x, y)) / 2
        error = math.sqrt(left / sum((a - mean) ** 2 for a in x))
        with Folder() as made:
            model = made.write("line.yaml", CURVE)
            data = made.write("line.csv", "x,y\n" + "".join(f"{a},{b}\n" for a, b in zip(x, y)))
            found = result("fit", model, data)
            b = next(p for p in found["parameters"] if p["name"] == "b")
            self.assertAlmostEqual(b["value"], slope, places=7)
            self.assertAlmostEqual(b["se"], error, places=7)
            self.assertAlmostEqual(b["ci95"][1] - b["value"], 4.302652729911275 * error, delta=2e-3 * error)
            plain = result("fit", model, data, "--errors", "likelihood", code=1)
            b = next(p for p in plain["parameters"] if p["name"] == "b")
            self.assertAlmostEqual(b["se"], error / math.sqrt(2), places=6)

    def test_the_noise_may_follow_the_curve(self):
        draw = random.Random(4)
        rows = [(x, 1 + 2 * x + 0.1 * (1 + 2 * x) * draw.gauss(0, 1)) for x in (0.01 * i for i in range(400))]
        text = CURVE.replace("outputs:", "let: {level: a + b*x}\noutputs:").replace("{y: s}", "{y: s*level}")
        with Folder() as made:
            got = values(result("fit", made.write("curve.yaml", text), made.write("curve.csv", "x,y\n" + "".join(f"{x},{y:.9g}\n" for x, y in rows))))
            self.assertAlmostEqual(got["s"], 0.1, delta=0.012)
            self.assertAlmostEqual(got["b"], 2, delta=0.05)


if __name__ == "__main__":
    unittest.main()
