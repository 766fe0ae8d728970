"""tune: values, methods, and what they print."""
import random
import unittest

from program import NILE, ROOT, Folder, result, run, shared


class Tune(unittest.TestCase):
    def test_nile_from_two_starts(self):
        for q, r in ((1000, 1000), (1, 1e6), (1e6, 1)):
            out = result("tune", *NILE, "--set", f"q={q}", "--set", f"r={r}", "--starts", 1)
            eta, eps = out["noise"]["Q"]["matrix"][0][0], out["noise"]["R"]["matrix"][0][0]
            print(f"nile from q={q:g} r={r:g}: eps {eps:.4f} eta {eta:.4f} "
                  f"log-likelihood {out['objective']['log_likelihood']:.7f}")
            self.assertAlmostEqual(eps / 15098.52, 1, delta=1e-4)
            self.assertAlmostEqual(eta / 1469.18, 1, delta=1e-4)
            self.assertAlmostEqual(out["objective"]["log_likelihood"], -632.545625, delta=1e-5)
        # Published for the observed information: 3145.5 and 1280.4.
        se = {p["name"]: p["se"] for p in out["parameters"]}
        self.assertAlmostEqual(se["r"], 3145.5, delta=1)
        self.assertAlmostEqual(se["q"], 1280.4, delta=1)

    def test_a_search_ends_after_as_many_iterations_as_it_may_take(self):
        done = run("tune", *NILE, "--set", "q=1", "--starts", 1, "--iterations", 2, code=3).stdout
        self.assertIn("2 iterations", done)
        out = result("tune", *NILE, "--set", "q=1", "--starts", 1, "--iterations", 400)
        self.assertAlmostEqual(out["objective"]["log_likelihood"], -632.545625, delta=1e-5)
        self.assertIn("--iterations does not apply", run("tune", *NILE, "--method", "als", "--iterations", 2, code=2).stderr)

    def test_components_that_miss_dynamics_are_compared_with_further_parts(self):
        with Folder() as folder:
            generator = random.Random(3)
            y = [0.0]
            for _ in range(300):
                y.append(0.9 * y[-1] + generator.gauss(0, 1))
            data = folder.write("data.csv", "y\n" + "\n".join(map(str, y)) + "\n")
            model = folder.write("model.yaml", """identikal: 1
time: {step: 1 s}
parameters: {q: {value: 1, min: 0}}
components: {y: {kind: arma, ma: 1, variance: q}}
outputs: {y: {column: y}}
""")
            out = result("tune", model, data, code=1)
            self.assertIn("expected_errors", [each["code"] for each in out["warnings"]])

    def test_system_7(self):
        data = shared("likelihood/sys7.csv")
        out = result("tune", ROOT / "examples/system7.yaml", data)
        values = [p["value"] for p in out["parameters"]]
        print(f"system 7: {values} log-likelihood {out['objective']['log_likelihood']:.9f}")
        for value, published in zip(values, (9.216211, 2.878235, 7.179994, 1.514810, 3.719302), strict=True):
            self.assertAlmostEqual(value / published, 1, delta=1e-4)
        self.assertAlmostEqual(out["objective"]["log_likelihood"], -17811.7503130, delta=1e-6)
        self.assertEqual(out["objective"]["starts_at_optimum"], out["objective"]["starts"])

    def test_als_of_system_7(self):
        data = shared("likelihood/sys7.csv")
        ml = result("tune", ROOT / "examples/system7.yaml", data)
        for extra in ([], ["--iterate"], ["--lags", 30]):
            out = result("tune", ROOT / "examples/system7.yaml", data, "--method", "als-weighted", *extra)
            for a, b in zip(out["parameters"], ml["parameters"], strict=True):
                self.assertLess(abs(a["value"] - b["value"]), 0.5 * b["se"], a["name"])
                self.assertAlmostEqual(a["crb_se"] / b["crb_se"], 1, delta=0.05)
        self.assertEqual(result("tune", ROOT / "examples/system7.yaml", data, "--method", "als")["objective"]["method"],
                         "als")

    def test_als_by_the_whole_matrix(self):
        data = shared("likelihood/sys7.csv")
        model = ROOT / "examples/system7.yaml"
        column = result("tune", model, data, "--method", "als")
        matrix = result("tune", model, data, "--method", "als", "--full-matrix")
        for a, b in zip(column["parameters"], matrix["parameters"], strict=True):
            self.assertNotEqual(a["value"], b["value"])
            self.assertLess(abs(a["value"] - b["value"]), a["se"], a["name"])
        for extra in (["--method", "als-weighted", "--full-matrix"], ["--method", "ml", "--full-matrix"],
                      ["--method", "ml", "--min-rank"], ["--method", "bayes", "--lags", 5],
                      ["--draws", 20], ["--method", "als", "--draws", 20], ["--method", "als", "--starts", 3],
                      ["--method", "als-weighted", "--seed", 1],
                      ["--method", "bayes", "--starts", 3], ["--method", "als-weighted", "--evaluation", "time-varying"],
                      ["--method", "bayes", "--evaluation", "steady-state"]):
            self.assertIn("does not apply", run("tune", model, data, *extra, code=2).stderr)

    def test_minimum_rank(self):
        # The noise of System 7 has three sources, all of them seen.
        data = shared("likelihood/sys7.csv")
        out = result("tune", ROOT / "examples/system7.yaml", data, "--method", "als-weighted", "--min-rank")
        self.assertEqual((out["minimum_rank"]["rank"], out["minimum_rank"]["of"]), (3, 3))
        self.assertEqual(out["minimum_rank"]["curve"][0]["rank"], 0)
        self.assertEqual(out["minimum_rank"]["curve"][-1]["penalty"], 0)
        text = run("tune", ROOT / "examples/system7.yaml", data, "--method", "als", "--min-rank", code=0).stdout
        self.assertIn("rank 3 of 3", text)
        self.assertTrue(all(len(line) <= 80 for line in text.splitlines()))

    def test_every_estimate_says_what_its_errors_cost(self):
        data = shared("likelihood/sys7.csv")
        for method in ("ml", "als", "als-weighted", "auto", "bayes"):
            out = result("tune", ROOT / "examples/system7.yaml", data, "--method", method,
                         *(("--draws", 500) if method == "bayes" else ()))
            loss = out["noise"]["excess_mean_square_error"]
            print(f"{method} of System 7: expected loss {100 * loss['relative']:.3f} %")
            self.assertTrue(1e-4 < loss["relative"] < 3e-3, loss)
            self.assertEqual((loss["without"], loss["reason"]), ([], ""))
        bound = result("bound", ROOT / "examples/system7.yaml", "-n", 3000)
        self.assertGreater(bound["noise"]["excess_mean_square_error"]["relative"], 0)
        self.assertIsNone(result("check", *NILE, code=1)["noise"]["excess_mean_square_error"])

    def test_auto_is_ml_with_a_second_opinion(self):
        data = shared("likelihood/sys7.csv")
        auto = result("tune", ROOT / "examples/system7.yaml", data, "--method", "auto")
        ml = result("tune", ROOT / "examples/system7.yaml", data)
        self.assertEqual(auto["objective"]["method"], "auto")
        self.assertEqual([], [w for w in auto["warnings"] if w["code"] == "methods_disagree"])
        for a, b in zip(auto["parameters"], ml["parameters"], strict=True):
            self.assertAlmostEqual(a["value"] / b["value"], 1, delta=1e-6)

    def test_same_bytes_but_for_the_time(self):
        first, second = (result("tune", *NILE) for _ in range(2))
        first["timing_s"] = second["timing_s"] = 0
        self.assertEqual(first, second)

    def test_the_same_data_twice_are_said(self):
        with Folder() as folder:
            copy = folder.write("copy.csv", open(NILE[1]).read())
            for more, words in (([NILE[1]], "is given twice: it counts twice"), ([copy], "is the same data as"), (["--hold-out", copy], "is held out and fitted")):
                said = [w for w in result("tune", *NILE, *more, "--starts", 1)["warnings"] if w["code"] in ("repeated_data", "own_data")]
                self.assertEqual(["warning"], [w["severity"] for w in said])
                self.assertIn(words, said[0]["text"])
            codes = [w["code"] for w in result("tune", *NILE, "--starts", 1, "--hold-out", "30%")["warnings"]]
            self.assertEqual([], [code for code in codes if code in ("repeated_data", "own_data")])

    def test_how_the_likelihood_is_evaluated(self):
        for name, words in (("time-varying", "time-varying filter"), ("steady-state", "steady-state filter"), ("autocovariances", "sample autocovariances")):
            text = run("tune", *NILE, "--starts", 1, "--evaluation", name).stdout
            self.assertIn("by " + words if name != "autocovariances" else "search from 1 start", " ".join(text.split()))
        self.assertIn("time_varying_filter", result("tune", *NILE, "--starts", 1, "--evaluation", "time-varying")["objective"]["evaluation_method"])

    def test_not_determined_is_exit_1(self):
        with Folder() as folder:
            model = folder.write("m.yaml", "identikal: 1\ntime: {kind: discrete, step: 1}\nA: [[0.5, 0], [0, 0.5]]\n"
                                 "C: [[1, 1]]\nQ: {structure: diagonal, start: 1}\nR: {structure: diagonal, start: 1}\n"
                                 "outputs: [{name: y, column: 1}]\n")
            data = folder.write("d.csv", "\n".join(str(random.Random(1).gauss(0, 1) + i % 3) for i in range(300)))
            out = result("tune", model, data, code=1)
            flat = [p for p in out["parameters"] if p["verdict"] == "not_identifiable"]
            self.assertEqual([p["name"] for p in flat], ["Q(1,1)", "Q(2,2)"])
            self.assertTrue(all(p["se"] is None and p["ci95"] == [None, None] for p in flat))
            self.assertIn("Q(1,1)", run("tune", model, data, code=1).stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
