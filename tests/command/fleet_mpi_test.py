"""A fleet by MPI: the same table for any number of ranks, also where one is killed. Without mpirun or the library that speaks MPI it is skipped."""
import os
import pathlib
import shutil
import signal
import subprocess
import time
import unittest

from fleet_test import Fleet
from program import PROGRAM, run

IS_THERE = shutil.which("mpirun") and (pathlib.Path(PROGRAM).parent / "libidentikal_mpi.so").exists()
FLEET = [PROGRAM, "fleet", "tune", "level.yaml", "drives", "-o", "mpi.store", "--engine", "mpi"]


def mpirun(ranks):
    return ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(ranks), *FLEET]


def rank_of(process):
    """The rank that mpirun has given to a process, with its parent's name; nothing of others."""
    try:
        given = [word for word in pathlib.Path(f"/proc/{process}/environ").read_bytes().split(b"\0") if word.startswith(b"OMPI_COMM_WORLD_RANK=")]
        return int(given[0].split(b"=")[1]) if given and b"mpi.store" in pathlib.Path(f"/proc/{process}/cmdline").read_bytes() else None
    except OSError:
        return None


@unittest.skipUnless(IS_THERE, "no MPI")
class Mpi(Fleet):
    recordings = 80
    rows = 3000

    def test_any_number_of_ranks_gives_the_same_table(self):
        self.tune("here.store")
        for ranks in (1, 2, 4):
            pathlib.Path("mpi.store").unlink(missing_ok=True)
            subprocess.run(mpirun(ranks), check=True, capture_output=True, timeout=120)
            self.assertEqual(self.table("mpi.store"), self.table("here.store"), ranks)

    def test_a_rank_that_is_killed_leaves_a_store_to_go_on_with(self):
        self.tune("here.store")
        job = subprocess.Popen(mpirun(3), stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        killed = False
        end = time.monotonic() + 60
        while job.poll() is None and not killed and time.monotonic() < end:
            for process in (int(name) for name in os.listdir("/proc") if name.isdigit()):
                if not killed and os.path.exists("mpi.store") and rank_of(process) == 2:
                    os.kill(process, signal.SIGKILL)
                    killed = True
        job.wait(timeout=60)
        self.assertTrue(killed)
        self.assertNotEqual(job.returncode, 0)
        run("fleet", "resume", "mpi.store", code=0)
        self.assertEqual(self.table("mpi.store"), self.table("here.store"))


if __name__ == "__main__":
    unittest.main()
