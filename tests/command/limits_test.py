"""Limits of memory, time and files: what is beyond them ends in one line, with what is known by then."""
import csv
import json
import signal
import subprocess
import time
import unittest

from interruption_test import long_search
from program import NILE, PROGRAM, ROOT, Folder, run

SYSTEM_7 = ROOT / "examples/system7.yaml"


class TestMemory(unittest.TestCase):
    def test_too_little_is_said(self):
        with Folder() as folder:
            rows = "".join(f"{k % 7}\n" for k in range(3_000_000))
            data = folder.write("long.csv", "level\n" + rows)
            done = run("tune", long_search(folder)[2], data, "-o", folder.path / "out", "--memory-limit", "60 MB", code=5)
            self.assertEqual(done.stderr, "identikal: not enough memory; expected less data, or more memory for this job\n")
            self.assertFalse((folder.path / "out").exists())

    def test_a_fleet_gives_up_what_is_too_large(self):
        with Folder() as folder:
            large = folder.write("large.csv", "level\n" + "".join(f"{k % 7}\n" for k in range(3_000_000)))
            again = folder.write("nile_again.csv", (ROOT / "data/nile.csv").read_bytes())
            done = run("fleet", "tune", NILE[0], NILE[1], large, again, "-o", folder.path / "store", "--workers", "1",
                       "--memory-limit", "70 MB", code=3)
            self.assertEqual(done.stderr, "")
            rows = list(csv.DictReader(run("fleet", "export", folder.path / "store").stdout.splitlines()))
            self.assertEqual([row["status"] for row in rows], ["ok", "failed", "ok"])
            self.assertIn("not enough memory", rows[1]["message"])

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

    def test_the_end_of_what_does_not_ask(self):
        over = "identikal: the time limit is over and there is no result yet; expected less data, or more time (--time-limit)\n"
        with Folder() as folder:
            run("simulate", SYSTEM_7, "-n", "20000", "-o", folder.path / "data")
            als = ["tune", SYSTEM_7, folder.path / "data/simulated.csv", "--method", "als", "--full-matrix", "--lags", "1000"]
            for job in (als, ["study", "matisko-table-1", "--runs", "100000"]):
                begin = time.monotonic()
                done = run(*job, "--time-limit", "1", "-o", folder.path / "out", code=5)
                self.assertLess(time.monotonic() - begin, 4)
                self.assertEqual(done.stderr.replace("\r", ""), over)
                self.assertFalse((folder.path / "out").exists())

    def test_time_enough_changes_nothing(self):
        for job in (["check", *NILE], ["tune", *NILE, "--method", "als"], ["bound", *NILE]):
            code = 1 if job[0] == "check" else 0
            self.assertEqual(run(*job, code=code).stdout, run(*job, "--time-limit", "1000", code=code).stdout)

    def test_a_signal_ends_als(self):
        """It does not ask whether to stop: the first signal ends it."""
        with Folder() as folder:
            run("simulate", SYSTEM_7, "-n", "20000", "-o", folder.path / "data")
            job = subprocess.Popen([PROGRAM, "tune", SYSTEM_7, folder.path / "data/simulated.csv", "--method", "als-weighted", "--lags", "1000",
                                    "-o", folder.path / "out"], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            time.sleep(1.0)
            begin = time.monotonic()
            job.send_signal(signal.SIGINT)
            job.communicate(timeout=30)
            self.assertEqual(job.returncode, -signal.SIGINT)
            self.assertLess(time.monotonic() - begin, 2)
            self.assertFalse((folder.path / "out").exists())


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
