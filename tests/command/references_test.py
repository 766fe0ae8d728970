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

    def test_a_reference_that_contradicts_decides_the_status(self):
        """The truth itself agrees with a filter of the right noise; ten times of it, another column, does not."""
        chance = random.Random(5)
        lines, p, v = ["t,z,truth,tenfold"], 0.0, 0.0
        for k in range(800):
            lines.append(f"{0.1 * k:.1f},{p + chance.gauss(0, 0.5)},{p},{10 * p}")
            p += 0.1 * v
            v += 0.1 * chance.gauss(0, 1)
        data = self.folder.write("right.csv", "\n".join(lines) + "\n")
        right = result("tune", self.model, data, "--starts", 1, code=0)
        (fit,) = right["references"]
        self.assertTrue(0.5 < fit["nees"] < 2, fit)
        self.assertTrue(10 < fit["independent"] < fit["rows"], fit)
        wrong = self.folder.write("wrong.yaml", MODEL + REFERENCE.replace("truth", "tenfold"))
        found = result("tune", wrong, data, "--starts", 1, "-o", self.folder.path / "wrong", code=1)
        self.assertEqual("untrusted", found["status"]["code"])
        texts = [w["text"] + w["remedy"] for w in found["warnings"] if w["code"] == "reference_band"]
        self.assertEqual(1, len(texts))
        self.assertIn("the reference's column, unit, axes and clock", texts[0])
        self.assertFalse([d for d in found["derived"] if d["name"].startswith("covariance factor")])
        again = result("validate", self.folder.path / "wrong", data, code=1)
        self.assertEqual("untrusted", again["status"]["code"])

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

    def test_ranges_of_several_recordings_go_on_each_from_its_own_rows(self):
        curved = self.folder.write("curved.yaml", MODEL.replace("{p: m, v: m/s}", "[p, v]").replace(
            "v: 0}", "v: -1e-12*sin(v)}").replace("unit: m, ", "").replace(
            "initial: diffuse", "initial: {mean: {p: 0, v: 0}, sd: {p: 1, v: 1}}"))
        values = ("--set", "q=0.05", "--set", "r=0.5")

        def likelihood(*arguments):
            done = run("check", curved, *arguments, *values, "--json")
            out = json.loads(done.stdout)
            return out["objective"]["log_likelihood"], [w["code"] for w in out["warnings"]]

        late = ("--range", "39.95s:1000s")
        alone = [likelihood(data, *late)[0] for data in (self.train, self.next)]
        both, codes = likelihood(self.train, self.next, *late)
        self.assertAlmostEqual(both, sum(alone), delta=1e-7)
        self.assertEqual(codes.count("goes_on"), 2)
        self.assertNotIn("starts_within", codes)
        given = self.folder.write("given.yaml", MODEL.replace(
            "initial: diffuse", "initial: {mean: {p: 1000, v: 0}, sd: {p: 1, v: 1}}"))
        diffuse = self.folder.write("diffuse.yaml", MODEL)
        found = [json.loads(run("check", model, self.train, self.next, *late, *values, "--json").stdout)
                 for model in (given, diffuse)]
        self.assertEqual(found[0]["objective"]["log_likelihood"], found[1]["objective"]["log_likelihood"])
        self.assertIn("starts diffuse, where --range begins", " ".join(w["text"] for w in found[0]["warnings"]))

    def test_extended_and_unscented_filters_are_compared_too(self):
        curved = self.folder.write("curved.yaml", MODEL.replace("{p: m, v: m/s}", "[p, v]").replace(
            "v: 0}", "v: -1e-12*sin(v)}").replace("unit: m, ", "").replace(
            "initial: diffuse", "initial: {mean: {p: 0, v: 0}, sd: {p: 1, v: 1}}") +
            "reference: {p: {column: truth}, twice: {column: truth, equals: 2*p, sd: 3}}\n")
        linear = result("filter", self.model, self.next, "--set", "q=0.05", "--set", "r=0.5")["references"][0]
        for method in ("extended", "iterated", "unscented"):
            arguments = (curved, self.next, "--set", "q=0.05", "--set", "r=0.5", "--filter", method)
            fits = result("filter", *arguments)["references"]
            self.assertEqual([fit["name"] for fit in fits], ["p", "twice"])
            for key in ("rmse", "nees", "coverage", "log_score"):
                self.assertAlmostEqual(fits[0][key], linear[key], delta=0.03 * abs(linear[key]))
            done = run("check", *arguments)
            self.assertRegex(done.stdout, r"states p +rmse [\d.]+, bias \S+, sd [\d.]+, NEES [\d.]+")
            self.assertRegex(done.stdout, r"log-score -?\d")

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
