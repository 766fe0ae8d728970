"""Student's t as measurement noise, from the command line and from the model file."""
import json
import math
import random
import unittest

from program import Folder, result, run, table

MODEL = """identikal: 1
name: tracker
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 0.1, min: 0}, r: {value: 1, min: 0}}
states: {p: m, v: m/s}
dynamics: {p: v, v: 0}
outputs: {z: {column: z, unit: m, equals: p}}
noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {z: r}}}
initial: diffuse
reference: {p: {column: truth, unit: m}}
"""
STUDENT = MODEL.replace("measurement: {", "measurement: {kind: student, freedom: 3, ")
MATRICES = """identikal: 1
name: level
time: {column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 0.01, min: 0}, r: {value: 1, min: 0}, nu: {value: 4, min: 1}}
A: [[1]]
C: [[1]]
Q: [[q]]
R: [[r]]
noise: {measurement: {kind: student, freedom: nu}}
outputs: [{name: z, column: z}]
initial: diffuse
"""


def drive(seed, rows=1200, freedom=2, level=False):
    """A position; level: one that wanders."""
    chance = random.Random(seed)
    p = v = 0.0
    lines = ["t,z,truth"]
    for k in range(rows):
        noise = chance.gauss(0, 1)
        if freedom:
            noise /= math.sqrt(sum(chance.gauss(0, 1) ** 2 for _ in range(freedom)) / freedom)
        lines.append(f"{0.1 * k:.1f},{p + 0.5 * noise},{p}")
        p += 0.1 * chance.gauss(0, 1) if level else 0.1 * v
        v += 0.05 * chance.gauss(0, 1)
    return "\n".join(lines) + "\n"


class Student(unittest.TestCase):
    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__)
        self.model = self.folder.write("tracker.yaml", MODEL)
        self.train, self.next = (self.folder.write(f"{seed}.csv", drive(seed)) for seed in (1, 2))

    def test_the_next_drive_is_filtered_better(self):
        normal, heavy = self.folder.path / "normal", self.folder.path / "heavy"
        run("tune", self.model, self.train, "--starts", 1, "-o", normal)
        done = run("tune", self.model, self.train, "--starts", 1, "--noise", "student", "-o", heavy)
        self.assertIn("predicts better than a normal distribution", done.stdout.replace("\n       ", " "))
        ours = result("filter", heavy / "student.yaml", self.next, "--from", heavy)["references"][0]
        theirs = result("filter", self.model, self.next, "--from", normal)["references"][0]
        self.assertLess(ours["rmse"], 0.8 * theirs["rmse"])
        self.assertGreater(ours["log_score"], theirs["log_score"])
        self.assertGreater(ours["coverage"], 0.9)
        self.assertIn(run("validate", heavy, self.next).returncode, (0, 1))
        text = run("export", heavy, "--to", "yaml", "--force", code=0).stdout
        self.assertIn("student", text)

    def test_the_model_file_says_it_too(self):
        model = self.folder.write("student.yaml", STUDENT)
        r = [p["value"] for p in result("tune", model, self.train, "--starts", 1)["parameters"] if p["name"] == "r"][0]
        self.assertAlmostEqual(r, 0.25, delta=0.12)
        self.assertIn(run("check", model, self.train).returncode, (0, 1))
        _, rows = table(run("filter", model, self.train).stdout)
        self.assertEqual(len(rows), 1200)

    def test_degrees_of_freedom_are_estimated(self):
        model = self.folder.write("level.yaml", MATRICES)
        found = result("tune", model, self.folder.write("level.csv", drive(4, level=True)), "--starts", 1)
        nu = [p["value"] for p in found["parameters"] if p["name"] == "nu"][0]
        self.assertTrue(1.3 < nu < 3.5, nu)
        normal = self.folder.write("normal.csv", drive(3, freedom=0, level=True))
        found = result("tune", model, normal, "--starts", 1)
        self.assertGreater([p["value"] for p in found["parameters"] if p["name"] == "nu"][0], 15)
        self.assertNotIn("predicts better", " ".join(found["notes"]))

    def test_what_does_not_go_with_it_is_refused(self):
        model = self.folder.write("student.yaml", STUDENT)
        for arguments in (("--method", "als"), ("--for", "estimates"), ("--reject-outliers",), ("--hold-out", "30%")):
            error = run("tune", model, self.train, *arguments, code=2).stderr
            self.assertIn("does not apply to Student's t", error)
        for verb, more in (("bound", ("-n", 100)), ("shape", (self.train,)), ("simulate", ("-n", 100))):
            error = run(verb, model, *more, code=2).stderr
            self.assertIn("takes normal measurement noise", error)
        for text, said in ((STUDENT.replace("freedom: 3", "freedom: 0.2"), "degrees of freedom, 1 or above"),
                           (STUDENT.replace("kind: student, ", ""), "kind: student beside it"),
                           (STUDENT.replace("student", "cauchy"), "student")):
            error = run("tune", self.folder.write("wrong.yaml", text), self.train, code=2).stderr
            self.assertRegex(error, r"wrong.yaml:8:\d+: ")
            self.assertIn(said, error)


if __name__ == "__main__":
    unittest.main()
