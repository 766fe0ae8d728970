"""export: the filter of a nonlinear model, as functions of C, C++ and Python, gives the states that 'filter' writes."""
import csv
import math
import random
import subprocess
import unittest

from export_test import compiled, interpreter_with_numpy
from program import TORQUE, Folder, run, table

MISSING = (17, 18, 40)

# Two angles that jump by turns, straight inputs, correlated noise, parameters in other units, a choice, a power.
STRAIGHT = """identikal: 1
name: 2 turns
time: {kind: continuous, step: 50 ms, inputs: foh, integration_step: 10 ms}
parameters: {k: {value: 120 1/min, min: 1}, class: {value: 40 cm, min: 1}, r: 1e-3, c: 4e-4, q: 0.02}
states: [phi, w]
inputs: {u: {column: u, unit: rad/s^2}, brake: {column: brake}}
dynamics: {phi: w, w: "u - k*w/(1 + (w/3)^2) - if(brake > 0.5, 2, 0)*w*k/class"}
outputs: {a: {unit: deg, equals: phi, wrap: true}, b: {unit: deg, equals: phi + class*w, wrap: true}}
noise: {process: {kind: per-sample, variance: {w: q}}}
R: [[r, c], [c, 2*r]]
initial: {mean: {phi: 0.2, w: 1}, sd: {phi: 0.3, w: 0.5}}
"""

DISCRETE = """identikal: 1
name: map
time: {kind: discrete, step: 1 s}
parameters: {a: {value: 0.9, min: 0}, q: 0.01, r: 0.04}
states: [x, z]
inputs: {u: {}}
dynamics: {x: "a*x + 0.3*tanh(z) + u", z: "0.5*z - hypot(x, 1) + min(x, u)"}
outputs: {y: {equals: "x + 0.2*z^2"}}
noise: {process: {variance: {x: q, z: q}}, measurement: {variance: {y: r}}}
initial: {mean: {x: 0, z: 0}, sd: {x: 1, z: 1}}
"""

DOSES = """identikal: 1
name: absorption
time: {kind: continuous, column: t, unit: s, sampling: irregular, integration_step: 50 ms}
parameters: {ka: {value: 1.2 1/s, min: 0.1}, V: {value: 8, min: 0.1}, q: 1e-3, r: 1e-2}
states: [gut, blood]
inputs: {amount: {}}
dynamics: {gut: -ka*gut, blood: ka*gut - 3*blood/(2 + blood)}
doses: {gut: amount}
outputs: {y: {equals: blood/V}}
noise: {process: {kind: density, variance: {blood: q}}, measurement: {variance: {y: r}}}
initial: {mean: {gut: 0, blood: 1}, sd: {gut: 0, blood: 0.5}}
"""


class ExportFilter(unittest.TestCase):
    def setUp(self):
        self.folder = Folder().__enter__()
        self.out = self.folder.path / "out"

    def tearDown(self):
        self.folder.__exit__()

    def agrees(self, name, model, inputs, outputs, scale, continuous, straight, simulate, bound=1e-12):
        """@param scale  from the columns to SI"""
        path = self.folder.write("m.yaml", model)
        run("simulate", path, *simulate, "-o", self.folder.path, code=0)
        lines = (self.folder.path / "simulated.csv").read_text().splitlines()
        rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
        heads = {h.split(" [")[0]: h for h in rows[0]}
        for t in MISSING:
            rows[t][heads[outputs[t % len(outputs)]]] = ""
        rows[60].update({heads[output]: "" for output in outputs})
        data = self.folder.path / "data.csv"
        with open(data, "w", newline="") as file:
            writer = csv.DictWriter(file, rows[0].keys())
            writer.writeheader()
            writer.writerows(rows)
        run("tune", path, data, "--starts", 1, "-o", self.out)
        head, states = table(run("filter", path, data, "--from", self.out, code=0).stdout)
        place = [i for i, h in enumerate(head) if i > 0 and "_sd" not in h]
        expected = [[float(row[i]) for i in place] + [float(row[i + 1]) for i in place] for row in states]
        of = lambda names: [[float(row[heads[n]]) * scale.get(n, 1.0) if row[heads[n]] else math.nan for n in names] for row in rows]
        u, y, time = of(inputs), of(outputs), [float(row[0]) for row in states]
        for language, compiler, standard in (("c", "gcc", "-std=c99"), ("cpp", "g++", "-std=c++17")):
            found = self.in_c(language, compiler, standard, name, u, y, time, continuous, straight)
            self.close(expected, found, language, bound)
        if interpreter_with_numpy():
            self.close(expected, self.in_python(u, y, time, continuous, straight), "python", bound)

    def close(self, expected, found, language, bound):
        self.assertEqual(len(expected), len(found))
        size = [max(abs(row[i]) for row in expected) or 1.0 for i in range(len(expected[0]))]
        worst = max(abs(a - b) / s for x, z in zip(expected, found) for a, b, s in zip(x, z, size))
        self.assertLess(worst, bound, language)
        print(f"{language}: within {worst:.1e} of the states and their deviations")

    def in_c(self, language, compiler, standard, name, u, y, time, continuous, straight):
        self.folder.write("model.h", run("export", self.out, "--to", language, "--force", code=0).stdout)
        pre = f"{name}_model_" if language == "c" else f"{name}_model::"
        n, nu, ny = len(time), len(u[0]), len(y[0])
        listed = lambda M: "{" + ", ".join("{" + ", ".join("NAN" if math.isnan(v) else repr(v) for v in row) + "}" for row in M) + "}"
        between = f"u[k < {n - 1} ? k + 1 : k], " if straight else ""
        to_next = f"{between}t[k], t[k + 1] - t[k]" if continuous else "t[k]"
        source = f"""#include "model.h"
#include <stdio.h>
static const double u[{n}][{nu}] = {listed(u)}, y[{n}][{ny}] = {listed(y)}, t[{n}] = {{{", ".join(map(repr, time))}}};
int main(void) {{
  {pre}state s = {pre}start();
  const int nx = (int)(sizeof s.x / sizeof s.x[0]);
  int i, k;
  for (k = 0; k < {n}; ++k) {{
    double e[{ny}];
    if ({pre}update(&s, u[k], y[k], t[k], e) != 0) return 1;
    for (i = 0; i < nx; ++i) printf("%.17g ", s.x[i]);
    for (i = 0; i < nx; ++i) printf("%.17g ", sqrt(s.P[i][i]));
    if (k + 1 < {n}) {pre}predict(&s, u[k], {to_next});
  }}
  return 0;
}}
"""
        found = compiled(self.folder, source, f"main.{language}", compiler, standard)
        return [found[k * len(found) // n:(k + 1) * len(found) // n] for k in range(n)]

    def in_python(self, u, y, time, continuous, straight):
        to_next = ("u[min(k + 1, len(t) - 1)], " if straight else "") + ("t[k], t[k + 1] - t[k]" if continuous else "t[k]")
        program = run("export", self.out, "--to", "python", "--force", code=0).stdout + f"""
nan = np.nan
u, y, t = {u!r}, {y!r}, {time!r}
x, P = x0[:, 0], P0
for k in range(len(t)):
    x, P, e, Sigma = update(x, P, u[k], y[k], t[k])
    print(*x, *np.sqrt(np.diag(P)))
    if k + 1 < len(t):
        x, P = predict(x, P, u[k], {to_next})
"""
        done = subprocess.run([interpreter_with_numpy(), "-W", "error", "-c", program], capture_output=True, text=True)
        self.assertEqual("", done.stderr)
        return [[float(v) for v in line.split()] for line in done.stdout.splitlines()]

    def test_continuous_inputs_held_density(self):
        pendulum = run("init", "pendulum", code=0).stdout
        how = [["torque"], ["angle"], {"angle": math.pi / 180}, True, False, ["-n", 200, *TORQUE]]
        self.agrees("pendulum", pendulum.replace("step: 20 ms", "step: 20 ms, integration_step: 4 ms"), *how)
        # As accuracy needs: more steps here and fewer there, the exported functions everywhere the most.
        self.agrees("pendulum", pendulum, *how, bound=1e-5)

    def test_straight_inputs_angles_that_jump(self):
        degrees = {"a": math.pi / 180, "b": math.pi / 180}
        self.agrees("model_2_turns", STRAIGHT, ["u", "brake"], ["a", "b"], degrees, True, True,
                    ["-n", 200, "--input", "u=8*sin(0.7*t) + 3", "--input", "brake=if(sin(t) > 0.8, 1, 0)"])

    def test_whole_matrices_of_noise(self):
        model = DISCRETE.replace("name: map", "name: whole").replace("q: 0.01, r: 0.04", "c: 1").replace(
            "noise: {process: {variance: {x: q, z: q}}, measurement: {variance: {y: r}}}", "Q: {structure: full, start: 0.01}\nR: {structure: diagonal, start: 0.04}")
        self.agrees("whole", model.replace("+ u\"", "+ c*u\""), ["u"], ["y"], {}, False, False, ["-n", 150, "--input", "u=0.3*sin(0.2*t)"])
        self.assertIn("double Q_2_1;  // -", run("export", self.out, "--to", "c", "--force", code=0).stdout)

    def test_discrete(self):
        self.agrees("map", DISCRETE, ["u"], ["y"], {}, False, False, ["-n", 150, "--input", "u=0.3*sin(0.2*t)"])

    def test_doses_at_irregular_times(self):
        random.seed(3)
        t, rows = 0.0, ["t,amount"]
        for k in range(120):
            rows.append(f"{t:.3f},{10 if k % 30 == 5 else 0}")
            t += random.choice([0.1, 0.25, 0.4])
        given = self.folder.write("given.csv", "\n".join(rows) + "\n")
        self.agrees("absorption", DOSES, ["amount"], ["y"], {}, True, False, [given])

    def test_what_has_no_functions_says_why(self):
        model = self.folder.write("m.yaml", run("init", "pendulum", code=0).stdout)
        run("simulate", model, "-n", 200, *TORQUE, "-o", self.folder.path, code=0)
        run("tune", model, self.folder.path / "simulated.csv", "--filter", "unscented", "--starts", 1, "-o", self.out)
        text = run("export", self.out, "--to", "c", "--force", code=0).stdout
        self.assertIn("// functions of the filter are not exported: its filter is unscented, not extended\n", text)
        self.assertNotIn("predict", text)


if __name__ == "__main__":
    unittest.main(verbosity=2)
