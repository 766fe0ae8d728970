"""compare: results of one recording, and models."""
import math
import pathlib
import unittest

from program import LANE_CHANGE, NILE, Folder, result, run, table


class Compare(unittest.TestCase):
    """A level that stands still inside one that wanders; the likelihood of the first is known in closed form."""

    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__, None, None, None)
        text = pathlib.Path(NILE[0]).read_text()
        still = text.replace("q: {value: 1000, min: 0, role: process-noise}", "q: 0")
        self.assertNotEqual(text, still)
        self.still = self.folder.write("still.yaml", still)
        self.a, self.b = self.folder.path / "still", self.folder.path / "wandering"
        run("tune", self.still, NILE[1], "-o", self.a)
        run("tune", *NILE, "-o", self.b)

    def test_nested(self):
        y = [row[1] for row in table(pathlib.Path(NILE[1]).read_text())[1]]
        n, mean = len(y), sum(y) / len(y)
        r = sum((v - mean) ** 2 for v in y) / (n - 1)
        L = -0.5 * (n - 1) * (math.log(2 * math.pi * r) + 1) - 0.5 * math.log(n)
        ratio = 2 * (-632.545625 - L)
        out = result("compare", self.a, self.b)
        tests = {(t["id"], t["channel"]): t for t in out["tests"]}
        self.assertAlmostEqual(tests["log_likelihood", str(self.a)]["value"], L, delta=1e-5)
        test = tests["likelihood_ratio", f"{self.a} in {self.b}"]
        self.assertAlmostEqual(test["value"], ratio, delta=1e-4)
        # q = 0 is a bound: half of P(chi-square > ratio) with one degree of freedom.
        self.assertAlmostEqual(test["p"] / (0.5 * math.erfc(math.sqrt(0.5 * ratio))), 1, delta=1e-4)
        self.assertAlmostEqual(test["interval"][1], 2.7055, delta=1e-3)
        self.assertFalse(test["pass"])
        self.assertAlmostEqual(tests["aic", str(self.a)]["value"], ratio - 2, delta=1e-4)
        self.assertAlmostEqual(tests["bic", str(self.a)]["value"], ratio - math.log(n), delta=1e-4)
        self.assertIn("wandering has the lowest AIC and BIC", out["status"]["message"])
        self.assertNotIn("names of their parameters", run("compare", self.a, self.b).stdout)
        text = run("compare", self.a / "result.json", self.b, code=0).stdout
        self.assertLessEqual(max(map(len, text.splitlines())), 80)
        self.assertEqual(text, run("compare", self.a, self.b).stdout)

    def test_nesting_is_more_than_names(self):
        text = pathlib.Path(self.still).read_text()
        other = self.folder.path / "other"
        for change, words in ((("A: [[1]]", "A: [[0.5]]"), "differ in more than what is known of q"),
                              (("A: [[1]]", "A: [[1, 0], [0, 1]]"), "taken from the names")):
            with self.subTest(change):
                model = text.replace(*change)
                self.assertNotEqual(model, text)
                if "[[1, 0]" in change[1]:
                    model = model.replace("C: [[1]]", "C: [[1, 1]]\nG: [[1], [0]]").replace("initial: diffuse", "initial: {mean: [1000, 0], sd: [1000, 1]}")
                whole = pathlib.Path(NILE[0]).read_text()
                if "[[1, 0]" in change[1]:
                    whole = whole.replace("initial: diffuse", "initial: {mean: [1000], sd: [1000]}")
                run("tune", self.folder.write("other.yaml", model), NILE[1], "-o", other)
                run("tune", self.folder.write("whole.yaml", whole), NILE[1], "-o", self.b)
                out = run("compare", other, self.b)
                self.assertEqual(0, out.returncode, out.stderr)
                self.assertIn(words, " ".join(out.stdout.split()))
                self.assertEqual("names" in words, "LR" in out.stdout)

    def test_nesting_of_formulas_and_cars(self):
        pendulum = run("init", "pendulum", code=0).stdout
        model = self.folder.write("p.yaml", pendulum)
        run("simulate", model, "-n", 400, "--input", "torque=1.5*sin(2*pi*0.4*t)", "-o", self.folder.path, code=0)
        data = self.folder.path / "simulated.csv"
        fixed = pendulum.replace("d: {value: 0.3 1/s, min: 0}", "d: 0.3 1/s")
        cars = [pathlib.Path(LANE_CHANGE[0]).read_text()]
        cars.append(cars[0].replace("curve: linear", "curve: tanh").replace("  Cr: {", "  Ff_max: {value: 9000 N, min: 1000}\n  Cr: {"))
        cars.append(cars[0].replace("outputs:", "sensors: {vy: {x: 0.3 m, y: 0 m}}\noutputs:").replace("  Iz: {value: 2000 kg m^2, min: 800, max: 6000}", "  Iz: 2000 kg m^2"))
        for small, large, words, tested in ((fixed, pendulum, "d free as well", True),
                                            (fixed.replace("phi: w", "phi: 1.1*w", 1), pendulum, "differ in more than what is known of d", False),
                                            (fixed.replace("{angle: r}", "{angle: 2*r}"), pendulum, "differ in more", False),
                                            (cars[0], cars[1], "with Ff_max, Fr_max at bounds", True),
                                            (cars[2], cars[0], "differ in more than what is known of Iz", False)):
            self.assertNotEqual(small, large)
            with self.subTest(words=words):
                recording = data if "pendulum" in large else LANE_CHANGE[1]
                for text, out in ((small, self.a), (large, self.b)):
                    run("fit", self.folder.write("m.yaml", text), recording, "--starts", 1, "-o", out)
                done = run("compare", self.a, self.b)
                text = " ".join(done.stdout.split())
                self.assertIn(words, text, done.stderr)
                self.assertNotIn("taken from the names", text)
                self.assertEqual(tested, "LR" in text)

    def test_what_it_refuses(self):
        def refused(words, *results):
            done = run("compare", *results, code=2)
            self.assertEqual(("", 1), (done.stdout, done.stderr.count("\n")), done.stderr)
            for word in words:
                self.assertIn(word, done.stderr)

        other = self.folder.path / "other"
        refused(["one result"], self.a)
        refused(["nowhere", "cannot be read"], self.a, self.folder.path / "nowhere")
        run("tune", *NILE, "--range", "0:80", "-o", other)
        refused(["other", "other rows"], self.a, other)
        # As many, but others.
        third = self.folder.path / "third"
        run("tune", *NILE, "--range", "10:90", "-o", third)
        refused(["third", "other rows"], other, third)
        run("tune", *NILE, "--method", "als-weighted", "-o", other)
        refused(["maximises no likelihood", "als-weighted"], self.a, other)
        run("fit", *LANE_CHANGE, "-o", other)
        refused(["another kind", "output_error"], self.a, other)
        run("check", *NILE, "-o", other)
        refused(["maximises no likelihood", "check"], other, self.a)
        text = (self.a / "result.json").read_text()
        for spoilt, words in ((text[:700], ["no whole JSON", "byte"]), ("[1, 2]", ["no result of this program"]),
                              (text.replace('"schema_version": 2', '"schema_version": 7'), ["schema_version 7"]),
                              (text.replace('"objective"', '"purpose"'), ["'objective' is missing"]),
                              (text.replace('"aic": ', '"aic": "no", "x": '), ["'objective.aic' is no number"])):
            (other / "result.json").write_text(spoilt)
            refused(["other/result.json", *words], self.a, other)


class CompareModels(unittest.TestCase):
    def test_compare(self):
        with Folder() as folder:
            run("simulate", NILE[0], "-n", 400, "--seed", 3, "-o", folder.path, code=0)
            data = folder.path / "simulated.csv"
            text = pathlib.Path(NILE[0]).read_text()
            other = folder.write("other.yaml", text.replace("r: {value: 1000", "r: {value: 50"))
            self.assertNotEqual(text, pathlib.Path(other).read_text())
            out = result("compare", other, NILE[0], data)
            ranked = [t["channel"] for t in out["tests"] if t["id"] == "log_likelihood"]
            self.assertEqual(ranked, [NILE[0], str(other)])
            self.assertIn("nile.yaml has the highest likelihood", out["status"]["message"])
            run("compare", NILE[0], data, code=2)
            run("compare", NILE[0], other, code=2)
            text = run("compare", other, NILE[0], data, code=0).stdout
            self.assertNotIn("(3.2", text)
            for words in ("Q mean", "Q max", "AR", "squared autocorrelations", "an autoregressive model", "passes the tests"):
                self.assertIn(words, text)
            for verb in ("check", "tune"):
                done = run(verb, other, NILE[0], data, code=2)
                self.assertIn("a model file where recordings are expected", done.stderr)
                self.assertIn("identikal compare A.yaml B.yaml DATA", done.stderr)
                self.assertEqual(1, done.stderr.count("\n"))


    def test_units_offsets_and_results(self):
        """The same filter in another unit is the same filter; results and models from data stand beside model files."""
        with Folder() as folder:
            run("simulate", NILE[0], "-n", 400, "--seed", 4, "-o", folder.path, code=0)
            data = folder.path / "simulated.csv"
            text = pathlib.Path(NILE[0]).read_text()
            scaled = text
            for name in "qr":
                scaled = scaled.replace(f"{name}: {{value: 1000", f"{name}: {{value: 0.1")
            scaled = scaled.replace("column: volume", "column: volume, scale: 0.01, offset: -3")
            self.assertEqual(3, sum(a != b for a, b in zip(text.splitlines(), scaled.splitlines())))
            other = folder.write("other.yaml", scaled)
            values = {t["channel"]: t["value"] for t in result("compare", NILE[0], other, data)["tests"] if t["id"] == "log_likelihood"}
            self.assertAlmostEqual(values[NILE[0]], values[str(other)], delta=1e-6)
            tuned, box = folder.path / "tuned", folder.path / "box"
            run("tune", NILE[0], data, "-o", tuned, code=0)
            run("model", data, "--output", "volume", "-o", box)
            out = result("compare", NILE[0], tuned, box, data)
            values = {t["channel"]: t["value"] for t in out["tests"] if t["id"] == "log_likelihood"}
            self.assertEqual({NILE[0], str(tuned), str(box)}, set(values))
            self.assertGreater(values[str(tuned)], values[NILE[0]])
            refused = run("compare", tuned, NILE[0], data, "--set", "q=1", code=2)
            self.assertIn("--set does not apply to results", refused.stderr)
            wrong = folder.write("wrong.yaml", scaled.replace("scale: 0.01", "scale: 0"))
            self.assertNotEqual(0, run("compare", NILE[0], wrong, data).returncode)


if __name__ == "__main__":
    unittest.main(verbosity=2)
