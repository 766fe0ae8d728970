"""simulate: manoeuvres, and truth that comes back."""
import json
import math
import subprocess
import unittest

from program import LANE_CHANGE, PROGRAM, ROOT, Folder, result, run, table


class Manoeuvres(unittest.TestCase):
    def test_manoeuvres(self):
        help_text = run("simulate", "--help", code=0).stdout
        self.assertTrue(help_text.startswith("Simulate a recording whose truth is known; without -o, print it.\n"))
        for name in ("severe-lane-change", "obstacle-avoidance", "double-lane-change", "step-steer", "sine", "sweep", "steady-circle",
                     "constant-steering", "weave", "sine-with-dwell"):
            self.assertIn(f"  {name} (", help_text)
            out = run("simulate", LANE_CHANGE[0], "--manoeuvre", name, "--rate", "20 Hz", "--snr", "30dB", code=0).stdout
            self.assertIn(f"# manoeuvre: {name} (", out)
            self.assertIn("# noise: vy 30 dB, sd ", out)
            self.assertIn("# truth: Cf = 80000 N/rad", out)

    def test_gates_are_told(self):
        with Folder() as folder:
            out = run("simulate", LANE_CHANGE[0], "--manoeuvre", "obstacle-avoidance", "--set", "Cf=88107.7", "--set", "Cr=88107.7", "--set",
                      "Iz=2319", "-o", folder.path, code=0).stdout
            self.assertEqual(out.count(": passed, clearance 0."), 3)
            fit = result("fit", LANE_CHANGE[0], folder.path / "simulated.csv")
            for p in fit["parameters"]:
                if p["name"] in ("Cf", "Cr"):
                    self.assertLess(abs(p["value"] - 88107.7), 4 * p["se"])


class Simulate(unittest.TestCase):
    def test_round_trip_linear(self):
        with Folder() as folder:
            model = ROOT / "examples/system7.yaml"
            run("simulate", model, "-n", 3000, "--seed", 5, "-o", folder.path, code=0)
            text = (folder.path / "simulated.csv").read_text()
            self.assertIn("# truth: Q(1,1) = 1", text)
            out = result("tune", model, folder.path / "simulated.csv")
            for p in out["parameters"]:
                self.assertLess(abs(p["value"] - 1), 4 * p["se"])


    def test_an_impulse(self):
        """y(t+1) = a y(t) + b u(t) + w: b a^(k-1) of the input, in units of y per unit of u, a^(k-1) of the noise, errors by the slopes."""
        text = ("identikal: 1\ntime: {step: 0.5 s}\nparameters: {a: {value: 0.7}, b: {value: 2}, q: {value: 1, min: 0}}\n"
                "A: [[a]]\nB: [[b]]\nC: [[1]]\nG: [[1]]\nQ: [[q]]\nR: [[0.01]]\n"
                "inputs: [{name: u, column: u, unit: km}]\noutputs: [{name: y, column: y}]\n")
        with Folder() as folder:
            model = folder.write("m.yaml", text)
            run("simulate", model, "-n", 400, "--input", "u=sin(t^1.5)", "-o", folder.path, code=0)
            run("tune", model, folder.path / "simulated.csv", "-o", folder.path / "tuned", code=0)
            found = json.loads((folder.path / "tuned/result.json").read_text())
            values = {p["name"]: p["value"] for p in found["parameters"]}
            se = {p["name"]: p["se"] for p in found["parameters"]}
            a, b = values["a"], values["b"]
            names = found["correlation"]["names"]
            rho = found["correlation"]["matrix"][names.index("a")][names.index("b")]
            head, rows = table(run("simulate", model, "--impulse", "u", "-n", 6, "--from", folder.path / "tuned", code=0).stdout)
            self.assertEqual(["time [s]", "y", "y_se", "y_low", "y_high"], head)
            self.assertEqual([0, 0, 0, 0, 0], rows[0])
            for k, row in list(enumerate(rows))[1:]:
                by_a, by_b = (k - 1) * b * a ** (k - 2), a ** (k - 1)
                variance = (by_a * se["a"]) ** 2 + (by_b * se["b"]) ** 2 + 2 * rho * by_a * by_b * se["a"] * se["b"]
                self.assertAlmostEqual(row[0], 0.5 * k)
                self.assertAlmostEqual(row[1], 1000 * b * a ** (k - 1), delta=1e-6)
                self.assertAlmostEqual(row[2], 1000 * math.sqrt(variance), delta=1e-5)
                self.assertAlmostEqual(row[4] - row[1], 1.959963985 * row[2], delta=1e-5)
            head, rows = table(run("simulate", model, "--impulse", "x1", "-n", 4, "--set", "a=0.5", code=0).stdout)
            self.assertEqual([[0, 0], [0.5, 1], [1, 0.5], [1.5, 0.25]], rows)
            held = folder.write("held.yaml", text.replace("{step: 0.5 s}", "{kind: continuous, step: 0.5 s, inputs: foh}").replace("Q:", "noise: {process: per-sample}\nQ:"))
            self.assertIn("held linearly", run("simulate", held, "--impulse", "u", "-n", 4, code=2).stderr)
            self.assertIn("no input or state 'v'", run("simulate", model, "--impulse", "v", "-n", 4, code=2).stderr)
            self.assertIn("number of rows", run("simulate", model, "--impulse", "u", code=2).stderr)

    def test_a_model_from_a_pipe(self):
        text = (ROOT / "examples/nile.yaml").read_text()
        done = subprocess.run([PROGRAM, "simulate", "/dev/stdin", "-n", "3"], input=text, capture_output=True, text=True, timeout=60)
        self.assertEqual((0, run("simulate", ROOT / "examples/nile.yaml", "-n", 3).stdout), (done.returncode, done.stdout))

    def test_round_trip_continuous(self):
        """An Ornstein-Uhlenbeck process: decay rate and noise density come back whatever the sampling."""
        text = ("identikal: 1\ntime: {kind: continuous, step: %s}\n"
                "parameters:\n  a: {value: -2, max: -0.01}\n  q: {value: 1, min: 0}\n  r: {value: 1, min: 0}\n"
                "A: [[a]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\nnoise: {process: density}\n"
                "outputs: [{name: y, column: y}]\n")
        for step in ("0.05 s", "200 ms"):
            with Folder() as folder:
                model = folder.write("m.yaml", text % step)
                run("simulate", model, "-n", 20000, "--seed", 7, "--set", "a=-1.5", "--set", "q=4", "--set", "r=0.5",
                    "-o", folder.path, code=0)
                out = result("tune", model, folder.path / "simulated.csv")
                self.assertEqual(out["noise"]["Q"]["kind"], "density")
                for p, truth in zip(out["parameters"], (-1.5, 4, 0.5), strict=True):
                    print(f"continuous, step {step}: {p['name']} {p['value']:.4f} +- {p['se']:.4f}, truth {truth}")
                    self.assertLess(abs(p["value"] - truth), 4 * p["se"])
                folder.write("m.yaml", (text % step).replace("noise: {process: density}\n", ""))
                self.assertIn("does not say what its Q is", run("tune", model, folder.path / "simulated.csv", code=2).stderr)

    def test_a_dose_is_given_once(self):
        """x' = -x/2 from a dose of 10 at 2 s."""
        with Folder() as folder:
            model = folder.write("m.yaml", """identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters: {k: 0.5 1/s, q: 1e-16, r: 1e-16}
states: [x]
inputs: {amount: {}}
dynamics: {x: -k*x*(1 + 0*x)}
doses: {x: amount}
outputs: {y: {equals: sqrt(x^2)}}
noise: {process: {kind: density, variance: {x: q}}, measurement: {variance: {y: r}}}
initial: {mean: {x: 0}, sd: {x: 0}}
""")
            given = folder.write("given.csv", "t,amount\n0,0\n1,0\n2,10\n3,0\n5,\n")
            run("simulate", model, given, "-o", folder.path, code=0)
            lines = [line for line in (folder.path / "simulated.csv").read_text().splitlines() if not line.startswith("#")]
            y = [float(line.split(",")[0]) for line in lines[1:]]
            for found, expected in zip(y, [0, 0, 0, 10 * math.exp(-0.5), 10 * math.exp(-1.5)]):
                self.assertAlmostEqual(found, expected, delta=1e-6)

    def test_inputs_by_formula_are_what_the_model_sees(self):
        """Their column is written before scale and offset, and that is said."""
        text = ("identikal: 1\ntime: {step: 1 s}\nA: [[0.5]]\nB: [[1]]\nC: [[1]]\nQ: [[0]]\nR: [[0.01]]\n"
                "inputs: [{name: u, column: valve, offset: -50}]\noutputs: [{name: y, column: y}]\n")
        with Folder() as folder:
            done = run("simulate", folder.write("m.yaml", text), "-n", 2, "--input", "u=1", code=0)
            self.assertIn("note: --input u is what the model sees: column 'valve' times 1 plus -50", done.stderr)
            rows = [line.split(",") for line in done.stdout.splitlines() if not line.startswith("#")]
            self.assertEqual("51", rows[1][rows[0].index("valve")])
            plain = folder.write("p.yaml", text.replace(", offset: -50", ""))
            self.assertEqual("", run("simulate", plain, "-n", 2, "--input", "u=1", code=0).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
