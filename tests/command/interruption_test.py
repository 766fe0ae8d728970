"""A signal ends a search with the best so far, written whole; a result that is none is not read to its end."""
import json
import os
import random
import signal
import subprocess
import time
import unittest

from program import PROGRAM, ROOT, Folder, run


def long_search(folder, *options):
    """The command of a search that goes on for half a minute."""
    source = random.Random(3)
    level, lines = 0.0, ["level"]
    for _ in range(40000):
        level += source.gauss(0, 1)
        lines.append(f"{level + source.gauss(0, 3)}")
    model = folder.write("model.yaml", "identikal: 1\ntime: {step: 1 s}\nA: [[1]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\n"
                         "parameters: {q: {value: 1e-3, min: 0}, r: {value: 1e3, min: 0}}\ninitial: diffuse\n"
                         "outputs: [{name: y, column: level}]\n")
    data = folder.write("data.csv", "\n".join(lines) + "\n")
    return [PROGRAM, "tune", model, data, "--starts", "1000", "--evaluation", "time-varying", "--threads", "1", *options]


class TestSignals(unittest.TestCase):
    def stopped_by(self, number, *more):
        with Folder() as folder:
            out = folder.path / "out"
            job = subprocess.Popen(long_search(folder, "-o", str(out)), stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            time.sleep(2.5)  # a slow machine takes one to come near
            job.send_signal(number)
            text, remarks = job.communicate(timeout=30)
            self.assertEqual(job.returncode, 128 + number, text + remarks)
            self.assertIn("stops with the best so far", remarks)
            stored = json.loads((out / "result.json").read_text())
            self.assertEqual(stored["status"]["code"], "not_converged")
            self.assertGreater(stored["parameters"][0]["value"], 0.1)
            self.assertEqual([p for p in out.iterdir() if p.name.startswith(".")], [])

    def test_interrupt(self):
        self.stopped_by(signal.SIGINT)

    def test_terminate(self):
        self.stopped_by(signal.SIGTERM)

    def test_a_signal_that_is_ignored_stays_so(self):
        with Folder() as folder:
            command = ["sh", "-c", 'trap "" INT; exec "$@"', "sh", *long_search(folder, "--json")]
            command[command.index("1000")] = "8"
            job = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
            time.sleep(0.3)
            job.send_signal(signal.SIGINT)
            text, remarks = job.communicate(timeout=60)
            self.assertNotEqual(job.returncode, 130)
            self.assertEqual(remarks, "")


class TestResultFolders(unittest.TestCase):
    """A folder holds the files of one run, whenever the program is killed. KILLS in the environment: how often."""

    def setUp(self):
        self.folder = Folder().__enter__()
        self.out = self.folder.path / "out"
        self.addCleanup(self.folder.__exit__)
        model = (ROOT / "examples/nile.yaml").read_text()
        rows = (ROOT / "data/nile.csv").read_text().splitlines()
        self.jobs, self.residuals = [], {}
        for name, text, lines in (("first", model, rows), ("second", model, rows[:60])):
            job = [PROGRAM, "tune", self.folder.write(name + ".yaml", text.replace("name: Nile", f"name: {name}")),
                   self.folder.write(name + ".csv", "\n".join(lines) + "\n"), "-o", str(self.out), "--quiet"]
            self.jobs.append(job)
            subprocess.run(job, capture_output=True)
            self.residuals[name] = (self.out / "residuals.csv").read_bytes()

    def check_whole(self):
        stored = json.loads((self.out / "result.json").read_text())
        data = json.loads((self.out / "report_data.json").read_text())
        name = stored["model"]["name"] if isinstance(stored["model"], dict) else stored["model"]
        self.assertEqual((self.out / "residuals.csv").read_bytes(), self.residuals[name])
        self.assertEqual(run("report", self.out, "--report", self.folder.path / "page.html").returncode, 0, data["sha256"])

    def test_killed(self):
        source = random.Random(5)
        kept = self.out / "notes.txt"
        kept.write_text("mine")
        for k in range(int(os.environ.get("KILLS", 60))):
            job = subprocess.Popen(self.jobs[k % 2], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            time.sleep(source.uniform(0.0, 0.03))
            job.kill()
            job.wait()
            self.check_whole()
            self.assertEqual(kept.read_text(), "mine")

    def test_two_at_once(self):
        for _ in range(int(os.environ.get("KILLS", 60)) // 4):
            for job in [subprocess.Popen(job, stdout=subprocess.DEVNULL) for job in self.jobs]:
                self.assertEqual(job.wait(), 0)
            self.check_whole()

    def test_a_folder_that_is_mounted_there(self):
        other = self.folder.path / "other"
        other.mkdir()
        script = 'mount --bind "$1" "$2" && shift 2 && exec "$@"'
        words = ["unshare", "-m", "sh", "-c", script, "sh", str(other), str(self.out)]
        if subprocess.run([*words, "true"], capture_output=True).returncode != 0:
            self.skipTest("folders cannot be mounted here")
        for job in self.jobs:
            done = subprocess.run([*words, *job], capture_output=True, text=True)
            self.assertEqual(done.returncode, 0, done.stderr)
        self.assertEqual(sorted(p.name for p in other.iterdir()), ["report_data.json", "residuals.csv", "result.json"])
        self.assertEqual((other / "residuals.csv").read_bytes(), self.residuals["second"])

    def test_files_of_an_earlier_result_go(self):
        (self.out / "course.csv").write_text("of an earlier run")
        (self.out / "notes.txt").write_text("mine")
        (self.out / "below").mkdir()
        subprocess.run(self.jobs[0], capture_output=True)  # a folder in it: file by file
        self.check_whole()
        (self.out / "below").rmdir()
        subprocess.run(self.jobs[1], capture_output=True)
        self.check_whole()
        self.assertEqual(sorted(p.name for p in self.out.iterdir()),
                         ["notes.txt", "report_data.json", "residuals.csv", "result.json"])
        self.assertEqual([p.name for p in self.folder.path.iterdir() if p.name.startswith(".")], [])


class TestEndlessResult(unittest.TestCase):
    def test_is_refused(self):
        done = run("report", "/dev/zero", code=2)
        self.assertIn("/dev/zero: is larger than 500 MB", done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
