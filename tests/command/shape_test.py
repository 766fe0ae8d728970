"""shape: coloured noise."""
import pathlib
import random
import tempfile
import unittest

from program import LANE_CHANGE, SYSTEM_1, result, run


class Shape(unittest.TestCase):
    """x+ = 0.5 x + v, v itself coloured with a pole pair at 1 rad."""

    def setUp(self):
        self.folder = tempfile.TemporaryDirectory()
        self.addCleanup(self.folder.cleanup)
        self.path = pathlib.Path(self.folder.name)
        self.model = self.path / "model.yaml"
        self.model.write_text(SYSTEM_1)
        chance = random.Random(7)
        x = v = before = 0.0
        rows, white = [], []
        for _ in range(3000):
            v, before = 1.0 * v - 0.86 * before + chance.gauss(0, 1), v
            rows.append(x + chance.gauss(0, 1))
            x = 0.5 * x + v
        x = 0.0
        for _ in range(3000):
            white.append(x + chance.gauss(0, 1))
            x = 0.5 * x + chance.gauss(0, 1)
        self.data, self.white = self.path / "data.csv", self.path / "white.csv"
        self.data.write_text("y\n" + "".join(f"{y:.9g}\n" for y in rows))
        self.white.write_text("y\n" + "".join(f"{y:.9g}\n" for y in white))

    def test_outputs_that_run_away(self):
        data = self.path / "powers.csv"
        data.write_text("y\n" + "".join(f"{1.5 ** k}\n" for k in range(150)))
        self.model.write_text(SYSTEM_1.replace("A: [[0.5]]", "A: [[1]]").replace("R: {", "initial: diffuse\nR: {"))
        run("shape", self.model, data, code=1)

    def test_the_filter_is_found_and_its_file_works(self):
        out = result("shape", self.model, self.data, "-o", self.path / "out")
        self.assertEqual(out["shaping"]["order"], 2)
        self.assertLess(out["shaping"]["whiteness_p"], 1e-6)
        pole = out["shaping"]["poles"][0]
        self.assertLess(abs(pole["radius"] - 0.86**0.5), 0.02)
        shaped = self.path / "out" / "shaped.yaml"
        same = self.path / "out" / "shaped_measurement.yaml"
        checked = result("check", shaped, self.data)
        self.assertAlmostEqual(
            result("check", same, self.data)["objective"]["log_likelihood"], checked["objective"]["log_likelihood"], 5)
        self.assertEqual(len(result("tune", same, self.data)["parameters"]), 2)
        again = result("tune", shaped, self.data, "--starts", "1")
        self.assertLess(abs(again["objective"]["log_likelihood"] - out["objective"]["log_likelihood"]), 1e-3)
        self.assertIn("identikal shape", run("tune", self.model, self.data).stdout.replace("\n", " "))

    def test_white_noise_is_exit_1_and_no_file(self):
        out = result("shape", self.model, self.white, "-o", self.path / "out", code=1)
        self.assertEqual(out["shaping"]["noise_source"], "")
        self.assertRegex(out["status"]["message"], r"^no coloured noise found: whiteness is not rejected \(p .*\), no shaping filter is needed$")
        self.assertFalse((self.path / "out" / "shaped.yaml").exists())

    def test_what_it_cannot_do(self):
        self.assertIn("linear model", run("shape", *LANE_CHANGE, code=2).stderr)
        self.assertIn("--hold-out", run("shape", self.model, self.data, "--hold-out", "0.99", code=2).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
