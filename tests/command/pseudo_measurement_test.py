"""Outputs whose number stands in the model file, and outputs that count under a condition."""
import random
import unittest

from program import Folder, result, run, table

# A speed from an accelerometer with a bias; what is known at standstill is that it is zero.
FORMULAS = """identikal: 1
name: standstill
time: {kind: continuous, column: t, unit: s, step: 0.1 s}
parameters: {qb: {value: 1e-4, min: 0}, r: {value: 0.04, min: 0}}
states: {v: m/s, b: m/s^2}
inputs: {a: {column: a, unit: m/s^2}}
flags: {wheel: {column: wheel, unit: km/h}}
dynamics: {v: a - b, b: 0}
outputs:
  gnss: {column: gnss, unit: m/s, equals: v, when: "abs(gnss) < 50"}
  stop: {value: 0 km/h, sd: 0.036, equals: v, when: "abs(wheel) < 0.1"}
noise: {process: {kind: density, variance: {v: 1e-3, b: qb}}, measurement: {variance: {gnss: r}}}
initial: diffuse
"""
MATRICES = """identikal: 1
name: standstill
time: {column: t, unit: s, step: 0.1 s}
parameters: {q: {value: 1e-3, min: 0}, r: {value: 0.04, min: 0}}
inputs: {a: {column: a, unit: m/s^2}}
flags: {wheel: {column: wheel, unit: km/h}}
A: [[1]]
B: [[0.1]]
C: [[1], [1]]
Q: [[q]]
R: [[r]]
outputs:
  gnss: {column: gnss, unit: m/s, when: "abs(gnss) < 50"}
  stop: {value: 0 km/h, sd: 0.036, when: "abs(wheel) < 0.1"}
initial: diffuse
"""
NONLINEAR = FORMULAS.replace("dynamics: {v: a - b", "dynamics: {v: a - b - 1e-12*sin(v)").replace(
    "states: {v: m/s, b: m/s^2}", "states: [v, b]").replace(
    "initial: diffuse", "initial: {mean: {v: 0, b: 0}, sd: {v: 1, b: 1}}")
# The same by hand: a column that holds the zero where it is known.
BY_HAND = """    gnss: {column: gnss, unit: m/s%s}
  stop: {column: zero, unit: m/s%s}
"""


def drive(seed=1, rows=900, by_hand=False):
    chance = random.Random(seed)
    v = 0.0
    lines = ["t,a,gnss,wheel,zero"]
    for k in range(rows):
        stands = (k // 100) % 3 == 0
        a = 0.0 if stands else chance.gauss(0, 1) - 0.3 * v
        v = 0.0 if stands else v
        gnss = v + 0.2 * chance.gauss(0, 1)
        wild = k % 97 == 5
        zero = "0" if abs(v) < 0.1 else ""
        lines.append(f"{0.1 * k:.1f},{a + 0.05},{999 if wild and not by_hand else '' if wild else gnss},"
                     f"{3.6 * v},{zero}")
        v += 0.1 * a
    return "\n".join(lines) + "\n"


def by_hand(model):
    """The model whose zeros and gaps stand in columns."""
    text = "\n".join(line for line in model.split("\n") if not line.startswith("flags"))
    return (text.replace(', when: "abs(gnss) < 50"', "").replace(', when: "abs(wheel) < 0.1"', "")
            .replace("value: 0 km/h, sd: 0.036", "column: zero, unit: m/s")
            .replace("measurement: {variance: {gnss: r}}", "measurement: {variance: {gnss: r, stop: 1e-4}}")
            .replace("R: [[r]]", "R: [[r, 0], [0, 1e-4]]"))


class PseudoMeasurements(unittest.TestCase):
    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__)
        self.data = self.folder.write("drive.csv", drive())
        self.hand_data = self.folder.write("hand.csv", drive(by_hand=True))

    def test_states_are_those_of_a_column_that_holds_the_number(self):
        for name, text in (("formulas", FORMULAS), ("matrices", MATRICES), ("nonlinear", NONLINEAR)):
            with self.subTest(name):
                model = self.folder.write(name + ".yaml", text)
                hand = self.folder.write(name + "_hand.yaml", by_hand(text))
                _, ours = table(run("filter", model, self.data, code=None).stdout)
                _, theirs = table(run("filter", hand, self.hand_data, code=None).stdout)
                self.assertEqual(len(ours), 900)
                for a, b in zip(ours, theirs):
                    self.assertEqual(a, b)

    def test_tune_takes_both_and_says_where_they_count(self):
        for name, text in (("formulas", FORMULAS), ("matrices", MATRICES), ("nonlinear", NONLINEAR)):
            with self.subTest(name):
                model = self.folder.write(name + ".yaml", text)
                out = self.folder.path / name
                done = run("tune", model, self.data, "--starts", 1, "-o", out)
                self.assertIn(done.returncode, (0, 1), done.stderr)
                said = " ".join(done.stdout.split())
                self.assertRegex(said, "stop counts in 4[0-9][0-9] of 900 rows of drive.csv, where abs.wheel. < 0.1")
                self.assertNotIn("nan", done.stdout)
                r = [p for p in result("tune", model, self.data, "--starts", 1, code=done.returncode)["parameters"]
                     if p["name"] == "r"][0]["value"]
                self.assertAlmostEqual(r, 0.04, delta=0.008)
                for verb, first in (("check", model), ("validate", out)):
                    done = run(verb, first, self.data)
                    self.assertIn(done.returncode, (0, 1), done.stderr)
                    self.assertNotIn("nan", done.stdout)
                    self.assertNotRegex(done.stdout, r"(ljung_box|one step|normality) +stop")

    def test_exports_say_it(self):
        model = self.folder.write("model.yaml", FORMULAS)
        out = self.folder.path / "out"
        run("tune", model, self.data, "--starts", 1, "-o", out)
        for format in ("cpp", "c", "matlab", "python", "json", "yaml"):
            text = run("export", out, "--to", format, "--force", code=0).stdout
            self.assertIn("abs(wheel) < 0.1", text, format)

    def test_simulated_recordings_are_read_back(self):
        model = self.folder.write("model.yaml", FORMULAS)
        out = self.folder.path / "simulated"
        run("simulate", model, "-n", 500, "--input", "a=sin(t)", "-o", out, code=0)
        text = (out / "simulated.csv").read_text()
        self.assertIn("gnss [m/s],a [m/s^2],wheel [km/h],t [s]", text)
        self.assertIn("# output stop, the pseudo-measurement 0 km/h, counts where abs(wheel) < 0.1", text)
        self.assertIn(run("tune", model, out / "simulated.csv", "--starts", 1).returncode, (0, 1))

    def test_mistakes_are_shown_where_they_stand(self):
        for text, line, said in (
                (FORMULAS.replace("abs(wheel) < 0.1", "wheeel < 0.1"), "11", "did you mean 'wheel'"),
                (FORMULAS.replace("abs(wheel) < 0.1", "wheel < a"), "11", "speed"),
                (FORMULAS.replace("abs(wheel) < 0.1", "wheel"), "11", "condition"),
                (FORMULAS.replace("abs(wheel) < 0.1", "stop < 0.1"), "11", "pseudo-measurement"),
                (FORMULAS.replace("value: 0 km/h", "value: 0 km"), "11", "a speed"),
                (FORMULAS.replace("sd: 0.036", "sd: 0.036 kg"), "11", "speed"),
                (FORMULAS.replace("sd: 0.036", "sd: 0"), "11", "above 0"),
                (FORMULAS.replace("value: 0 km/h", "value: 0 km/h, column: zero"), "11", "one of 'value' and 'column'"),
                (FORMULAS.replace("{column: gnss,", "{column: gnss, sd: 1,"), "10", "beside a 'value'"),
                (FORMULAS.replace("{gnss: r}", "{gnss: r, stop: 1}"), "12", "sd of its own"),
                (FORMULAS.replace("wheel: {", "gnss: {"), "7", "is a channel already"),
                (FORMULAS.replace("abs(wheel) < 0.1", "gnss < 0.1"), "7", "no output asks the flag"),
                (MATRICES.replace("R: [[r]]", "R: {structure: full}").replace("r: {value: 0.04, min: 0}", "z: 1"),
                 "11", "estimated as a whole")):
            error = run("filter", self.folder.write("model.yaml", text), self.data, code=2).stderr
            self.assertRegex(error, rf"model.yaml:{line}:\d+: ", text)
            self.assertIn(said, error)
        error = run("filter", self.folder.write("model.yaml", FORMULAS.replace("column: wheel", "column: weel")),
                    self.data, code=2).stderr
        self.assertRegex(error, r"model.yaml:7:\d+: no column 'weel'")


if __name__ == "__main__":
    unittest.main()
