"""fit --objective simulation: formulas fitted to what they do on their own."""
import json
import math
import random
import unittest

from program import Folder, result, run

TANK = """identikal: 1
name: tank
time: {kind: continuous, step: 1 s}
parameters:
  k: {value: 0.3 1/s, min: 0.01, max: 1}
  b: {value: 0.5 1/s, min: 0.01, max: 1}
  q: {value: 1e-3 1/s, min: 0}
  r: {value: 1e-4, min: 0}
states: {h: 1}
inputs: {u: {column: u, unit: 1}}
dynamics: {h: "b*u - k*sqrt(max(h, 1e-6))"}
outputs: {y: {column: y, unit: 1, equals: h}}
noise: {process: {kind: density, variance: {h: q}}, measurement: {variance: {y: r}}}
initial: {mean: {h: 2}, sd: {h: 1}}
"""
# The same without a curve: what is read as formulas is fitted as such, though it is linear.
LINEAR = TANK.replace("k*sqrt(max(h, 1e-6))", "k*h")


def tank(rows, start, seed, linear=False, noise=0.01):
    draw, h, out = random.Random(seed), start, ["u,y"]
    for t in range(rows):
        u = 1 + 0.6 * math.sin(0.05 * t + seed)
        out.append(f"{u:.9g},{h + noise * draw.gauss(0, 1):.9g}")
        for _ in range(40):
            h += (0.3 * u - 0.2 * (h if linear else math.sqrt(max(h, 1e-6)))) / 40
    return "\n".join(out) + "\n"


def values(found):
    return {p["name"]: p["value"] for p in found["parameters"]}


class Objective(unittest.TestCase):
    def test_parameters_and_starts_are_found(self):
        with Folder() as made:
            model, one, two = made.write("tank.yaml", TANK), made.write("one.csv", tank(300, 1, 1)), made.write("two.csv", tank(300, 3, 2))
            alone = result("fit", model, one, "--objective", "simulation")
            both = result("fit", model, one, two, "--objective", "simulation")
            for found, starts in ((alone, {"h_start": 1}), (both, {"h_start_1": 1, "h_start_2": 3})):
                self.assertEqual("ok", found["status"]["code"], found["status"])
                self.assertEqual("simulation", found["objective"]["method"])
                for name, truth in ({"k": 0.2, "b": 0.3} | starts).items():
                    self.assertAlmostEqual(values(found)[name], truth, delta=0.02 * truth + 0.01, msg=name)

    def test_linear_formulas_take_it_too(self):
        with Folder() as made:
            model, log = made.write("tank.yaml", LINEAR), made.write("log.csv", tank(300, 1, 1, linear=True))
            found = values(result("fit", model, log, "--objective", "simulation"))
            self.assertAlmostEqual(found["k"], 0.2, delta=0.005)

    def test_a_result_is_validated_by_its_simulation(self):
        with Folder() as made:
            model, one, two = made.write("tank.yaml", TANK), made.write("one.csv", tank(300, 1, 1)), made.write("two.csv", tank(300, 3, 2))
            run("fit", model, one, "--objective", "simulation", "-o", made.path / "fitted")
            good = result("validate", made.path / "fitted", two)
            self.assertEqual("ok", good["status"]["code"])
            self.assertGreater(good["fit"]["simulation"]["y"]["fit_percent"], 90)
            other = made.write("other.csv", tank(300, 3, 2, linear=True))
            self.assertEqual("rejected", result("validate", made.path / "fitted", other, code=1)["status"]["code"])

    def test_a_model_that_runs_away_holds_nowhere(self):
        model_of_growth = LINEAR.replace("k: {value: 0.3 1/s, min: 0.01, max: 1}", "k: {value: -0.02 1/s}")
        with Folder() as made:
            draw = random.Random(3)
            growing = "".join(f"1,{15 * (math.exp(0.02 * t) - 1) + 0.01 * draw.gauss(0, 1):.9g}\n" for t in range(60))
            model, one, two = (made.write(*file) for file in (("growing.yaml", model_of_growth), ("one.csv", "u,y\n" + growing),
                                                              ("two.csv", tank(300, 3, 2, linear=True))))
            run("fit", model, one, "--objective", "simulation", "-o", made.path / "fitted")
            found = result("validate", made.path / "fitted", two, code=1)
            self.assertEqual("rejected", found["status"]["code"])
            self.assertLess(found["fit"]["simulation"]["y"]["fit_percent"], 0)

    def test_a_standard_deviation_keeps_its_name(self):
        by_sd = TANK.replace("r: {value: 1e-4, min: 0}", "r: {value: 0.02, min: 0}").replace("variance: {y: r}", "sd: {y: r}")
        with Folder() as made:
            log = made.write("log.csv", tank(300, 1, 1))
            found = [values(result("fit", made.write("tank.yaml", text), log, "--objective", "simulation")) for text in (TANK, by_sd)]
            self.assertEqual(found[0].keys(), found[1].keys())
            self.assertAlmostEqual(found[0]["r"], found[1]["r"] ** 2, delta=1e-6 * found[0]["r"])
            fixed = made.write("fixed.yaml", TANK.replace("variance: {y: r}", "sd: {y: 0.2}").replace("  r: {value: 1e-4, min: 0}\n", ""))
            unit = {p["name"]: p["unit"] for p in result("fit", fixed, log, "--objective", "simulation")["parameters"]}
            self.assertEqual("1", unit["var_y"])
            rows = [line.split(",") for line in tank(300, 1, 1, linear=True).split()[1:]]
            centimetres = "u,y\n" + "".join(f"{u},{100 * float(y):.9g}\n" for u, y in rows)
            cm = made.write("cm.yaml", """identikal: 1
time: {kind: continuous, step: 1 s}
parameters: {k: {value: 0.3 1/s, min: 0.01}, b: {value: 0.5 1/s, min: 0.01}}
states: {h: m}
inputs: {u: {column: u, unit: m}}
dynamics: {h: b*u - k*h}
outputs: {y: {column: y, unit: cm, equals: h}}
noise: {measurement: {sd: {y: 20 cm}}}
initial: {mean: {h: 2 m}, sd: {h: 1 m}}
""")
            unit = {p["name"]: p["unit"] for p in result("fit", cm, made.write("linear.csv", centimetres), "--objective", "simulation")["parameters"]}
            self.assertEqual("cm^2", unit["var_y"])

    def test_a_result_of_before_is_read(self):
        by_sd = TANK.replace("r: {value: 1e-4, min: 0}", "r: {value: 0.02, min: 0}").replace("variance: {y: r}", "sd: {y: r}")
        with Folder() as made:
            model, one, two = made.write("tank.yaml", by_sd), made.write("one.csv", tank(300, 1, 1)), made.write("two.csv", tank(300, 3, 2))
            run("fit", model, one, "--objective", "simulation", "-o", made.path / "fitted")
            now = result("validate", made.path / "fitted", two)
            written = made.path / "fitted" / "result.json"
            found = json.loads(written.read_text())
            size = next(p for p in found["parameters"] if p["name"] == "r")
            found["parameters"].append(size | {"name": "var_y", "unit": "", "value": size["value"] ** 2})
            size |= {"value": 0.0, "fixed": True}
            written.write_text(json.dumps(found))
            before = result("validate", made.path / "fitted", two)
            self.assertEqual(now["status"], before["status"])
            self.assertAlmostEqual(now["objective"]["log_likelihood"], before["objective"]["log_likelihood"], delta=1e-6)

    def test_held_out_rows_are_simulated_on(self):
        with Folder() as made:
            model, log = made.write("tank.yaml", TANK), made.write("log.csv", tank(400, 1, 1))
            found = result("fit", model, log, "--objective", "simulation", "--hold-out", "25%")
            self.assertGreater(found["fit"]["hold_out"]["y"]["fit_percent"], 90)

    def test_what_does_not_apply_is_one_line(self):
        with Folder() as made:
            model, log = made.write("tank.yaml", TANK), made.write("log.csv", tank(100, 1, 1))
            matrices = made.write("m.yaml", "identikal: 1\ntime: {step: 1 s}\nparameters: {q: {value: 1, min: 0}}\nA: [[0.9]]\nC: [[1]]\nQ: [[q]]\nR: [[1]]\ninitial: stationary\noutputs: {y: {column: y}}\n")
            prior = made.write("p.yaml", TANK.replace("b: {value: 0.5 1/s, min: 0.01, max: 1}", "b: {value: 0.5 1/s, prior: {normal: {mean: 0.3, sd: 0.1}}}"))
            for arguments, words in (((matrices, log), "belongs to formulas"), ((prior, log), "the prior of b"),
                                     ((model, log, "--reject-outliers"), "not white")):
                done = run("fit", *arguments, "--objective", "simulation", code=2)
                self.assertIn(words, done.stderr)
                self.assertEqual(1, done.stderr.count("\n"), done.stderr)


if __name__ == "__main__":
    unittest.main()
