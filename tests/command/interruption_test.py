"""A signal ends a search with the best so far, written whole; a result that is none is not read to its end."""
import json
import random
import signal
import subprocess
import time
import unittest

from program import PROGRAM, Folder, run


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
            time.sleep(1.0)
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


class TestEndlessResult(unittest.TestCase):
    def test_is_refused(self):
        done = run("report", "/dev/zero", code=2)
        self.assertIn("/dev/zero: is larger than 500 MB", done.stderr)
        self.assertEqual(done.stderr.count("\n"), 1)


if __name__ == "__main__":
    unittest.main()
