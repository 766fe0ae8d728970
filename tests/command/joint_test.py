"""One likelihood of all recordings of a fleet: shared, per group, per recording, drawn from a population; by several processes."""
import json
import math
import os
import pathlib
import random
import shutil
import subprocess
import unittest

from program import PROGRAM, Folder, result, run

IS_THERE = shutil.which("mpirun") and (pathlib.Path(PROGRAM).parent / "libidentikal_mpi.so").exists()

COOLING = """identikal: 1
name: cooling
time: {kind: continuous, step: 20 s}
parameters:
  k: {value: 2e-3 1/s, min: 0, per: recording, spread: 0.3}
  T0: {value: 60, per: recording}
  room: {value: 18, per: group}
  s: {value: 1, min: 0}
states: [T]
dynamics: {T: -k*(T - room)}
outputs: {y: {column: T, equals: T}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {T: T0}}
"""
LEVEL = """identikal: 1
name: level
time: {kind: discrete, step: 1 s}
parameters:
  q: {value: 1, min: 0}
  r: {value: 1, min: 0, per: recording, spread: 0.5}
A: [[1]]
C: [[1]]
Q: [[q]]
R: [[r]]
noise: {process: per-sample}
initial: diffuse
outputs: [{name: level, column: y}]
"""
CURVE = """identikal: 1
model: static
parameters:
  top: {value: 90, per: recording, spread: 20}
  rate: {value: 0.5, min: 0, per: recording, spread: 0.5}
  s: {value: 1, min: 0}
inputs: {x: {column: x}}
outputs: {y: {column: y, equals: top*(1 - exp(-rate*x))}}
noise: {measurement: {sd: {y: s}}}
"""
UNITS = 12


def cup(rng, k, start, room):
    return "T\n" + "".join(f"{room + (start - room) * math.exp(-k * 20 * t) + 0.5 * rng.gauss(0, 1):.6f}\n" for t in range(60))


def walk(rng, q, r):
    x, out = 0.0, "y\n"
    for _ in range(150):
        x += rng.gauss(0, q ** 0.5)
        out += f"{x + rng.gauss(0, r ** 0.5):.4f}\n"
    return out


def curves(rng, correlation=0.0):
    rows = "who,x,y\n"
    for unit in range(30):
        a, b = rng.gauss(0, 1), rng.gauss(0, 1)
        top, rate = 100 + 15 * a, 0.6 * math.exp(0.3 * (correlation * a + math.sqrt(1 - correlation ** 2) * b))
        for x in (0.5, 1, 2, 3, 5, 8):
            rows += f"u{unit},{x},{top * (1 - math.exp(-rate * x)) + rng.gauss(0, 2):.4f}\n"
    return rows


def values(found):
    return {p["name"]: p["value"] for p in found["parameters"]}


class Joint(unittest.TestCase):
    def setUp(self):
        self.folder = Folder().__enter__()
        self.here = os.getcwd()
        os.chdir(self.folder.path)

    def tearDown(self):
        os.chdir(self.here)
        self.folder.__exit__()

    def cups(self):
        rng = random.Random(4)
        rows = "recording,group\n"
        for i in range(UNITS):
            group = "window" if i % 3 == 0 else "kitchen"
            k = 1e-3 * math.exp(0.2 * rng.gauss(0, 1))
            self.folder.write(f"cup{i}.csv", cup(rng, k, rng.uniform(60, 90), 12 if group == "window" else 20))
            rows += f"cup{i}.csv,{group}\n"
        self.folder.write("cups.csv", rows)
        self.folder.write("cooling.yaml", COOLING)

    def test_what_is_shared_per_group_per_recording_and_drawn(self):
        self.cups()
        found = result("fleet", "joint", "cooling.yaml", "cups.csv", "--workers", "1")
        self.assertEqual(found["status"]["code"], "ok", found["status"])
        got = values(found)
        rows = {p["name"]: p for p in found["parameters"]}
        for name, truth in {"room_window": 12, "room_kitchen": 20, "k": 1e-3, "sd_k": 0.2, "s": 0.5}.items():
            self.assertAlmostEqual(got[name], truth, delta=4 * rows[name]["se"], msg=name)
        self.assertEqual(sum(name.startswith("T0_") for name in got), UNITS)
        self.assertEqual(sum(name.startswith("k_") for name in got), UNITS)
        for name in ("k", "sd_k", "k_cup3", "T0_cup3", "room_window", "s"):
            low, high = rows[name]["ci95"]
            self.assertTrue(low < rows[name]["value"] < high, name)

    def test_several_processes_find_the_same(self):
        self.cups()
        alone = result("fleet", "joint", "cooling.yaml", "cups.csv", "--workers", "1")
        for workers in ("2", "5"):
            shared = result("fleet", "joint", "cooling.yaml", "cups.csv", "--workers", workers)
            self.assertAlmostEqual(shared["objective"]["log_likelihood"], alone["objective"]["log_likelihood"], delta=1e-12 * abs(alone["objective"]["log_likelihood"]))
            for name, value in values(alone).items():
                self.assertAlmostEqual(values(shared)[name], value, delta=1e-7 * abs(value), msg=name)

    @unittest.skipUnless(IS_THERE, "no MPI")
    def test_ranks_of_mpi_find_the_same(self):
        self.cups()
        alone = result("fleet", "joint", "cooling.yaml", "cups.csv", "--workers", "1")
        for ranks in (1, 2, 4):
            command = ["mpirun", "--allow-run-as-root", "--oversubscribe", "-n", str(ranks), PROGRAM, "fleet", "joint", "cooling.yaml", "cups.csv", "--engine", "mpi", "--json"]
            shared = json.loads(subprocess.run(command, check=True, capture_output=True, text=True, timeout=120).stdout)
            self.assertAlmostEqual(shared["objective"]["log_likelihood"], alone["objective"]["log_likelihood"], delta=1e-12 * abs(alone["objective"]["log_likelihood"]))

    def test_covariances_may_be_drawn_too(self):
        rng = random.Random(8)
        for i in range(UNITS):
            self.folder.write(f"w{i}.csv", walk(rng, 1.0, 4.0 * math.exp(0.5 * rng.gauss(0, 1))))
        self.folder.write("level.yaml", LEVEL)
        found = result("fleet", "joint", "level.yaml", "w*.csv", "--workers", "2")
        got = values(found)
        self.assertAlmostEqual(got["q"], 1, delta=0.4)
        self.assertAlmostEqual(got["r"], 4, delta=2)
        self.assertAlmostEqual(got["sd_r"], 0.5, delta=0.3)

    def test_units_of_one_file_with_correlated_values(self):
        self.folder.write("curves.csv", curves(random.Random(6), 0.8))
        self.folder.write("curve.yaml", CURVE)
        independent = result("fleet", "joint", "curve.yaml", "curves.csv", "--by", "who", "--workers", "1")
        self.folder.write("curve.yaml", CURVE + "spreads: correlated\n")
        found = result("fleet", "joint", "curve.yaml", "curves.csv", "--by", "who", "--workers", "1", "-o", "all")
        self.assertGreater(found["objective"]["log_likelihood"], independent["objective"]["log_likelihood"] + 2)
        derived = {d["name"]: d for d in found["derived"]}
        self.assertAlmostEqual(derived["correlation between top and rate"]["value"], 0.8, delta=0.3)
        # What was found is the start of another search.
        text = run("export", "all", "--to", "yaml", code=0).stdout
        self.folder.write("again.yaml", text)
        again = result("fleet", "joint", "again.yaml", "curves.csv", "--by", "who", "--workers", "1")
        self.assertAlmostEqual(again["objective"]["log_likelihood"], found["objective"]["log_likelihood"], delta=1e-5)

    def test_a_recording_that_is_new_has_the_mean(self):
        self.cups()
        run("fleet", "joint", "cooling.yaml", "cups.csv", "--workers", "1", "-o", "cups")
        new = self.folder.write("cup99.csv", cup(random.Random(3), 1e-3, 80, 20))
        text = pathlib.Path("cooling.yaml").read_text() + "recordings:\n  cup99: {group: kitchen, T0: 80}\n"
        self.folder.write("new.yaml", text)
        done = run("filter", "new.yaml", new, "--from", "cups/result.json")
        self.assertEqual(done.returncode, 0, done.stderr)

    def test_mistakes_are_one_line(self):
        self.cups()
        for text, said in ((COOLING.replace("spread: 0.3", "spread: 0"), "spread of parameter 'k' is '0'; expected above 0"),
                           (COOLING.replace("per: recording, spread: 0.3", "spread: 0.3"), "per: recording, or a label, with it"),
                           (COOLING.replace("spread: 0.3", "spread: 0.3 m"), "m"),
                           (COOLING + "spreads: some\n", "independent"),
                           (COOLING.replace(", spread: 0.3", "") + "spreads: correlated\n", "no parameter has a spread"),
                           (COOLING.replace("T0: {value: 60, per: recording}", "T0: {value: 60, per: group, spread: 5}"), "the same 'per'")):
            self.folder.write("wrong.yaml", text)
            refused = run("fleet", "joint", "wrong.yaml", "cups.csv", "--workers", "2", code=2)
            self.assertEqual(refused.stderr.strip().count("\n"), 0, refused.stderr)
            self.assertIn(said, refused.stderr)
        self.folder.write("two.csv", "recording,group\ncup0.csv,a\ncup1.csv,a\n")
        self.assertIn("a spread between 2 recordings", run("fleet", "joint", "cooling.yaml", "two.csv", code=2).stderr)
        self.folder.write("none.csv", "recording\ncup0.csv\ncup1.csv\n")
        self.assertIn("has no group", run("fleet", "joint", "cooling.yaml", "none.csv", code=2).stderr)
        self.assertIn("with --objective simulation", run("fit", "cooling.yaml", "cup0.csv", "cup1.csv", "cup2.csv", "--objective", "simulation", code=2).stderr)
        self.assertIn("--workers does not apply", run("fleet", "joint", "cooling.yaml", "cups.csv", "--engine", "mpi", "--workers", "2", code=2).stderr)


if __name__ == "__main__":
    unittest.main()
