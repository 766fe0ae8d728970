"""Estimates against references that a model file names, and what --for estimates makes of them."""
import json
import random
import unittest

from program import Folder, result, run

MODEL = """identikal: 1
name: tracker
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 0.1, min: 0}, r: {value: 1, min: 0}}
states: {p: m, v: m/s}
dynamics: {p: v, v: 0}
outputs: {z: {column: z, unit: m, equals: p}}
noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {z: r}}}
initial: diffuse
"""
REFERENCE = "reference: {p: {column: truth, unit: m}}\n"


def drive(seed, rows=800):
    chance = random.Random(seed)
    p = v = error = 0.0
    lines = ["t,z,truth"]
    for k in range(rows):
        error = 0.95 * error + 0.3 * chance.gauss(0, 1)
        lines.append(f"{0.1 * k:.1f},{p + error + chance.gauss(0, 0.5)},{p if k % 4 else ''}")
        p += 0.1 * v
        v += 0.02 * chance.gauss(0, 1)
    return "\n".join(lines) + "\n"


class References(unittest.TestCase):
    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__)
        self.model = self.folder.write("tracker.yaml", MODEL + REFERENCE)
        self.train, self.next = (self.folder.write(f"{seed}.csv", drive(seed)) for seed in (1, 2))

    def rmse(self, folder):
        fits = result("filter", self.model, self.next, "--from", folder)["references"]
        self.assertEqual([fit["name"] for fit in fits], ["p"])
        return fits[0]["rmse"]

    def test_filters_tuned_for_estimates_are_closer_on_the_next_drive(self):
        likeliest, closest = self.folder.path / "likeliest", self.folder.path / "closest"
        run("tune", self.model, self.train, "--starts", 1, "-o", likeliest)
        run("tune", self.model, self.train, "--starts", 2, "--for", "estimates", "-o", closest, code=0)
        self.assertLess(self.rmse(closest), 0.95 * self.rmse(likeliest))
        codes = [w["code"] for w in json.loads((likeliest / "result.json").read_text())["warnings"]]
        self.assertIn("reference_disagrees", codes)

    def test_the_reference_changes_nothing_that_is_estimated(self):
        plain = self.folder.write("plain.yaml", MODEL)
        for key in ("parameters", "tests", "objective"):
            self.assertEqual(result("tune", plain, self.train, "--starts", 1, code=1)[key],
                             result("tune", self.model, self.train, "--starts", 1, code=1)[key])

    def test_a_range_goes_on_from_the_rows_before(self):
        """Conditional likelihoods add up: log p(all) = log p(first) + log p(second | first)."""
        values = ("--set", "q=0.05", "--set", "r=0.5")

        def likelihood(*more):
            done = run("check", self.model, self.next, *values, *more, "--json")
            return json.loads(done.stdout)["objective"]["log_likelihood"]

        whole, first, second = likelihood(), likelihood("--range", "0s:39.95s"), likelihood("--range", "39.95s:1000s")
        self.assertAlmostEqual(whole, first + second, delta=1e-7)

    def test_what_has_no_reference_is_refused(self):
        plain = self.folder.write("plain.yaml", MODEL)
        without = self.folder.write("without.csv", "\n".join(line.rsplit(",", 1)[0] for line in drive(3).split("\n")))
        error = run("tune", plain, self.train, "--for", "estimates", code=2).stderr
        self.assertIn("the model names no reference of its states", error)
        error = run("tune", self.model, without, "--for", "estimates", code=2).stderr
        self.assertIn("the recordings hold no value of a reference", error)
        self.assertEqual(result("filter", self.model, without)["references"], [])
        error = run("tune", self.model, self.train, "--for", "estimates", "--method", "als", code=2).stderr
        self.assertIn("--for estimates does not apply to --method als", error)
        error = run("tune", self.model, self.train, "--for", "estimates", "--lags", 3, code=2).stderr
        self.assertIn("--lags does not apply to --for estimates", error)

    def test_extensions_are_tried_and_the_model_is_written(self):
        out = self.folder.path / "extended"
        run("tune", self.model, self.train, "--extend", "--starts", 1, "-o", out)
        result_file = json.loads((out / "result.json").read_text())
        self.assertIn("an error that lasts, of z", " ".join(result_file["notes"]))
        self.assertTrue((out / "extended.yaml").exists())
        self.assertEqual(result_file["model_file"]["text"], (out / "extended.yaml").read_text())
        names = {p["name"] for p in result_file["parameters"]}
        self.assertLess({"q", "r"}, names)
        self.assertRegex("\n".join(result_file["notes"]), r"adopted")
        fits = result("filter", out / "extended.yaml", self.next, "--from", out)["references"]
        self.assertEqual(["p"], [fit["name"] for fit in fits])
        error = run("tune", self.model, self.train, "--extend", "--hold-out", "30%", code=2).stderr
        self.assertIn("--hold-out does not apply with --extend", error)


if __name__ == "__main__":
    unittest.main()
