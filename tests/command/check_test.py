"""check: is a filter optimal?"""
import unittest

from program import NILE, Folder, result, run


class Check(unittest.TestCase):
    def test_optimal_and_not(self):
        with Folder() as folder:
            run("simulate", NILE[0], "-n", 400, "--seed", 3, "-o", folder.path, code=0)
            data = folder.path / "simulated.csv"
            out = result("check", NILE[0], data, code=0)
            self.assertTrue(all(t["pass"] for t in out["tests"] if t["level"] is not None))
            self.assertAlmostEqual(sum(t["level"] or 0 for t in out["tests"]), 0.05)
            out = result("check", NILE[0], data, "--set", "r=10", code=1)
            self.assertEqual(out["status"]["code"], "rejected")
            self.assertIn("not optimal", out["status"]["message"])
            self.assertIn("r should be larger", out["status"]["message"])
            self.assertGreater([d["value"] for d in out["derived"] if d["name"] == "excess mean-square error"][0], 5)

    def test_losses_have_sensible_digits(self):
        with Folder() as folder:
            run("simulate", NILE[0], "-n", 400, "--seed", 3, "-o", folder.path, code=0)
            run("tune", NILE[0], folder.path / "simulated.csv", "-o", folder.path / "out")
            run("export", folder.path / "out", "--to", "yaml", "-o", folder.path / "tuned.yaml", code=0)
            # At its own maximum a filter loses nothing but rounding.
            text = run("check", folder.path / "tuned.yaml", folder.path / "simulated.csv").stdout
            self.assertRegex(text, r"excess mean-square error +< 0\.001 %")
            text = run("bound", NILE[0], "-n", 1000000000).stdout
            self.assertIn("excess mean-square error at least < 0.001 % of tr P", text)
            text = run("bound", NILE[0], "-n", 3).stdout
            self.assertRegex(text, r"excess mean-square error at least \d+ % of tr P")

    def test_nothing_is_said_of_nothing(self):
        with Folder() as folder:
            for values in (["5"] * 100, [""] * 99 + ["1"], ["1", "2", "3"]):
                data = folder.write("data.csv", "year,volume\n" + "".join(f"{i},{v}\n" for i, v in enumerate(values)))
                self.assertEqual(len(run("check", NILE[0], data, code=2).stderr.splitlines()), 1)


if __name__ == "__main__":
    unittest.main(verbosity=2)
