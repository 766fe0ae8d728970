"""A fleet on a real Slurm: the same table as here, also where tasks are thrown back into the queue. Needs a Slurm that runs, else it is skipped."""
import os
import random
import subprocess
import time
import unittest

from fleet_test import Fleet, walk
from program import run

ONE_NODE = "SLURM_CONF" in os.environ


def squeue(*options):
    return subprocess.run(["squeue", "-h", *options], capture_output=True, text=True).stdout.split()


@unittest.skipUnless(ONE_NODE, "no Slurm: SLURM_CONF is not set")
class Slurm(Fleet):
    recordings = 60
    rows = 2000

    def test_an_array_gives_the_same_table(self):
        self.tune("here.store")
        self.tune("there.store", "--engine", "slurm", "--shards", 5, "--wait")
        self.assertEqual(self.table("there.store"), self.table("here.store"))
        self.assertIn("0 done now", run("fleet", "resume", "there.store", code=0).stdout)

    def test_requeued_tasks_change_nothing(self):
        self.tune("here.store")
        self.tune("there.store", "--engine", "slurm", "--shards", 6)
        requeued = 0
        end = time.monotonic() + 500  # a task that was thrown back waits two minutes
        while squeue() and time.monotonic() < end:
            for task in squeue("-t", "R", "-o", "%i"):
                if requeued < 8 and random.random() < 0.5 and "_" in task:
                    requeued += subprocess.run(["scontrol", "requeue", task], capture_output=True).returncode == 0
            time.sleep(0.1)
        self.assertGreater(requeued, 0)
        print(f"{requeued} tasks thrown back into the queue")
        run("fleet", "merge", "there.store", code=0)
        self.assertEqual(self.table("there.store"), self.table("here.store"))

    def test_a_refusal_is_told(self):
        done = run("fleet", "tune", "level.yaml", "drives", "-o", "f.store", "--engine", "slurm", "--sbatch=--partition=absent", code=5)
        self.assertEqual(done.stderr.count("\n"), 1)
        self.assertIn("sbatch refuses", done.stderr)


if __name__ == "__main__":
    unittest.main()
