"""Limits of memory, time and files: what is beyond them ends in one line, with what is known by then."""
import json
import time
import unittest

from interruption_test import long_search
from program import NILE, Folder, run


class TestMemory(unittest.TestCase):
    def test_too_little_is_said(self):
        with Folder() as folder:
            rows = "".join(f"{k % 7}\n" for k in range(3_000_000))
            data = folder.write("long.csv", "level\n" + rows)
            done = run("tune", long_search(folder)[2], data, "-o", folder.path / "out", "--memory-limit", "60 MB", code=5)
            self.assertEqual(done.stderr, "identikal: not enough memory; expected less data, or more memory for this job\n")
            self.assertFalse((folder.path / "out").exists())

    def test_enough_changes_nothing(self):
        self.assertEqual(run("tune", *NILE).stdout, run("tune", *NILE, "--memory-limit", "1 GB").stdout)

    def test_sizes(self):
        for text in ("much", "3", "1 MB", "-1 GB", "nan GB", "1e30 GB"):
            done = run("info", NILE[1], "--memory-limit", text, code=2)
            self.assertIn("is no size; expected 50 MB or more", done.stderr)


class TestTime(unittest.TestCase):
    def test_the_best_so_far(self):
        with Folder() as folder:
            begin = time.monotonic()
            done = run(*long_search(folder, "--time-limit", "2", "--json")[1:], code=3)
            self.assertLess(time.monotonic() - begin, 8)
            out = json.loads(done.stdout)
            self.assertEqual(out["status"]["code"], "not_converged")
            self.assertGreater(out["parameters"][0]["value"], 0.01)  # from 0.001 on

    def test_not_of_what_does_not_ask(self):
        self.assertIn("--time-limit does not apply to --method als", run("tune", *NILE, "--method", "als", "--time-limit", "2", code=2).stderr)


class TestIncludedFiles(unittest.TestCase):
    def test_no_more_than_a_hundred(self):
        with Folder() as folder:
            for k in range(7):
                folder.write(f"{k}.yaml", "include: [" + ", ".join([f"{k + 1}.yaml"] * 10) + "]\n")
            folder.write("7.yaml", "name: bomb\n")
            done = run("check", folder.path / "0.yaml", NILE[1], code=2)
            self.assertRegex(done.stderr, r":1:\d+: too many files are included; expected at most 100 in all")


if __name__ == "__main__":
    unittest.main()
