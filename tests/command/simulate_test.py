"""simulate: manoeuvres, and truth that comes back."""
import subprocess
import unittest

from program import LANE_CHANGE, PROGRAM, ROOT, Folder, result, run


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


if __name__ == "__main__":
    unittest.main(verbosity=2)
