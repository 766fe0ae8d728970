"""study and bound: published tables and figures, the Cramer-Rao bound."""
import csv
import unittest
from xml.etree import ElementTree

from program import NILE, Folder, result, run, table


class Study(unittest.TestCase):
    def test_study(self):
        text = run("study", "matisko-table-9", "--runs", 3, "--quiet", code=0).stdout
        self.assertIn("published: ALS+SDP 30 lags, R0 1", text)
        self.assertIn("ours: ALS 30 lags, R0 1", text)
        self.assertIn("Cramer-Rao bound", text)
        self.assertEqual(text, run("study", "matisko-table-9", "--runs", 3, "--quiet", code=0).stdout)

    def test_study_of_a_figure(self):
        with Folder() as first, Folder() as second:
            text = run("study", "matisko-figure-14", "--runs", 2, "--threads", 1, "-o", first.path, code=0).stdout
            run("study", "matisko-figure-14", "--runs", 2, "--threads", 3, "-o", second.path, code=0)
            names = sorted(f.name for f in first.path.iterdir())
            self.assertEqual([f"matisko-figure-14.{e}" for e in ("csv", "svg", "txt")], names)
            for name in names:
                self.assertEqual((first.path / name).read_bytes(), (second.path / name).read_bytes(), name)
            self.assertEqual(text, (first.path / "matisko-figure-14.txt").read_text())
            picture = ElementTree.parse(first.path / "matisko-figure-14.svg").getroot()
            self.assertEqual("{http://www.w3.org/2000/svg}svg", picture.tag)
            words = " ".join("".join(e.itertext()) for e in picture.iter("{http://www.w3.org/2000/svg}text"))
            for word in ("samples k", "variance of the estimate of Q", "Cramér-Rao bound", "maximum likelihood"):
                self.assertIn(word, words)
            table = list(csv.reader((first.path / "matisko-figure-14.csv").read_text().splitlines()))
            self.assertEqual([13] * 8, [len(row) for row in table])


class Bound(unittest.TestCase):
    def test_bound(self):
        out = result("bound", NILE[0], "-n", 100, "--set", "q=1469.1", "--set", "r=15099", "--accuracy", "10%")
        self.assertEqual(out["bound"]["samples"], 100)
        needed = [p["samples_needed"] for p in out["bound"]["parameters"]]
        self.assertAlmostEqual(needed[0], 100 * (out["parameters"][0]["crb_se"] / 146.91) ** 2, delta=0.05 * needed[0])
        with Folder() as folder:
            run("bound", NILE[0], "-n", 100, "-o", folder.path, code=0)
            self.assertEqual(["result.json"], [f.name for f in folder.path.iterdir()])


if __name__ == "__main__":
    unittest.main(verbosity=2)
