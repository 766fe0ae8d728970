"""Is an answer on bad data usable, or does it say why not?"""
import pathlib
import random
import unittest

from program import SYSTEM_1, Folder, result, run, shared


class BadData(unittest.TestCase):
    """One recording of System 1 (Q = 10, R = 1), spoilt: a usable answer, or words."""

    def setUp(self):
        lines = pathlib.Path(shared("noise/sys1.csv")).read_text().split()[1:]
        self.y = [float(line.split(",")[0]) for line in lines]
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__, None, None, None)
        self.model = self.folder.write("model.yaml", SYSTEM_1)

    def tuned(self, y, *extra, code=0):
        data = self.folder.write("data.csv", "y\n" + "".join(f"{v}\n" for v in y))
        out = result("tune", self.model, data, *extra, code=code)
        return out["noise"]["Q"]["matrix"][0][0], out["noise"]["R"]["matrix"][0][0], {
            w["code"]: w for w in out["warnings"]}

    def test_a_missing_sample(self):
        for method in ("ml", "als", "als-weighted"):
            Q, _, warnings = self.tuned(self.y[:500] + [""] + self.y[501:], "--method", method)
            self.assertAlmostEqual(Q, 11.3, delta=0.2)
            self.assertEqual({}, warnings)

    def test_a_size_beyond_numbers(self):
        for scale in (1e150, 1e-155, 1e300):
            data = self.folder.write("data.csv", "y\n" + "".join(f"{v * scale}\n" for v in self.y))
            for method in ("ml", "als", "als-weighted", "auto"):
                done = run("tune", self.model, data, "--method", method, code=2)
                self.assertRegex(done.stderr, "^identikal: data.csv: output 'y' is of the size of .*; expected 1e-75 to 1e75")
                self.assertEqual(done.stderr.count("\n"), 1)

    def test_outliers(self):
        spoilt = list(self.y)
        for t in (200, 500, 800):
            spoilt[t] += 100
        for method in ("ml", "als-weighted"):
            _, R, warnings = self.tuned(spoilt, "--method", method, code=1)
            self.assertGreater(R, 20)
            self.assertEqual("serious", warnings["outliers"]["severity"])
            self.assertIn("200 s, 500 s, 800 s", warnings["outliers"]["text"])
            Q, R, warnings = self.tuned(spoilt, "--method", method, "--reject-outliers")
            print(f"three outliers of +100, {method} --reject-outliers: Q {Q:.3f} R {R:.3f}")
            self.assertAlmostEqual(Q, 11.3, delta=0.2)
            self.assertAlmostEqual(R, 0.2, delta=0.1)
            self.assertIn("3 samples", warnings["outliers_left_out"]["text"])
        self.assertEqual(self.tuned(self.y), self.tuned(self.y, "--reject-outliers"))

    def test_an_offset(self):
        for method in ("ml", "als-weighted"):
            warning = self.tuned([v + 5 for v in self.y], "--method", method, code=1)[2]["offset"]
            self.assertEqual("serious", warning["severity"])
            offset = float(warning["text"].split("An offset of ")[1].split()[0])
            self.assertAlmostEqual(offset, 5, delta=0.5)

    def test_a_drift_is_no_offset(self):
        """What a model integrates takes any constant in: no offset explains innovations with a mean."""
        walk = SYSTEM_1.replace("A: [[0.5]]", "A: [[1]]").replace("R: {", "initial: diffuse\nR: {")
        slow = walk.replace("A: [[1]]", "A: [[0.99999]]")
        chain = walk.replace("A: [[1]]", "A: [[0.6, 0.4], [0.3, 0.7]]").replace("C: [[1]]", "C: [[0.7, 0.1]]").replace("Q: {", "G: [[1], [0.3]]\nQ: {")
        drifting = [v + 3 * t for t, v in enumerate(self.y)]
        for name, text in (("walk", walk), ("slow", slow), ("chain", chain)):
            with self.subTest(name):
                self.model = self.folder.write("model.yaml", text)
                _, _, warnings = self.tuned(drifting, "--starts", 1, code=1)
                text = warnings["offset"]["text"]
                self.assertNotIn("would explain", text)
                self.assertIn("takes" if name == "slow" else "no offset of a sensor", text)
                self.assertIn("add a drift", warnings["offset"]["remedy"])

    def test_a_short_recording(self):
        for method in ("ml", "als-weighted"):
            Q, R, warnings = self.tuned(self.y[:90], "--method", method, code=1)  # a sensor without noise is not believed
            self.assertAlmostEqual(Q, 12, delta=1)
            self.assertEqual(R, 0)
            self.assertIn("R(1,1)", warnings["at_bound"]["text"])

    def test_coloured_process_noise(self):
        random.seed(1)
        x = w = 0.0
        y = []
        for _ in range(1000):
            w = 0.9 * w + random.gauss(0, (10 * 0.19) ** 0.5)
            x = 0.5 * x + w
            y.append(x + random.gauss(0, 1))
        for method in ("ml", "als-weighted"):
            self.assertIn("coloured_innovations", self.tuned(y, "--method", method, code=1)[2])


if __name__ == "__main__":
    unittest.main(verbosity=2)
