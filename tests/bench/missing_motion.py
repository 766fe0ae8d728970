#!/usr/bin/env python3
"""Does `tune` tell a motion that lacks a term from one that is complete?

usage: missing_motion.py TOOL [RECORDINGS]

Five systems of physics, RECORDINGS of each (20), with process and measurement noise, and models of them by formulas: the complete
one, and one that lacks a term (a motor without its dry friction, a reservoir without the height of its sill, an oscillator
without its limit cycle, a house without its walls, an epidemic without recovery). Printed per system: how many end `ok` with
the complete model, how many of these have some parameter outside of its 95 % interval (of all parameters of all
recordings 5 % are expected to), and how many end `ok` with the other.
"""
import csv
import json
import pathlib
import subprocess
import sys
import tempfile

import numpy as np

HEAD = "identikal: 1\nname: {}\n"
MODELS = {
    "motor": ("""time: {kind: continuous, column: t, unit: s}
states: {th: rad, w: rad/s}
parameters:
  k: {value: 20 rad/s^2, min: 1, max: 200}
  b: {value: 1 1/s, min: 0.01, max: 20}
  c: {value: 1 rad/s^2, min: 0, max: 20}
  w0: 0.2 rad/s
  sw: {value: 0.5, min: 0.001, max: 10}
  se: {value: 0.01 rad, min: 0.0001, max: 1}
inputs: {u: {column: u}}
outputs: {angle: {column: y, unit: rad, equals: th}}
dynamics: {th: w, w: k*u - b*w - c*tanh(w/w0)}
noise: {process: {kind: density, sd: {w: sw}}, measurement: {sd: {angle: se}}}
initial: {mean: {th: 0, w: 0}, sd: {th: 0.1 rad, w: 0.1 rad/s}}
""", dict(k=30, b=2, c=3, sw=0.3, se=0.02), [(" - c*tanh(w/w0)", ""), ("  c: {value: 1 rad/s^2, min: 0, max: 20}\n  w0: 0.2 rad/s\n", "")]),
    "reservoir": ("""time: {kind: continuous, column: t, unit: h}
states: {h: m}
parameters:
  area: {value: 2 km^2, min: 0.1, max: 50}
  c: {value: 10 m^1.5/s, min: 0.1, max: 200}
  sill: {value: 0.5 m, min: 0, max: 0.9}
  s: {value: 0.001, min: 1e-6, max: 0.1}
  e: {value: 0.01 m, min: 0.0001, max: 1}
inputs: {q: {column: u, unit: m^3/s}}
outputs: {level: {column: y, unit: m, equals: h}}
dynamics: {h: "(q - c*max(h - sill, 0)^1.5)/area"}
noise: {process: {kind: density, sd: {h: s}}, measurement: {sd: {level: e}}}
initial: {mean: {h: 1.5 m}, sd: {h: 0.5 m}}
""", dict(area=4, c=20, sill=0.4, s=3e-4, e=0.02), [("max(h - sill, 0)^1.5", "h^1.5"), ("  sill: {value: 0.5 m, min: 0, max: 0.9}\n", "")]),
    "oscillator": ("""time: {kind: continuous, column: t, unit: s}
states: [x, v]
parameters:
  mu: {value: 1, min: -10, max: 10}
  om: {value: 1, min: 0.1, max: 10}
  g: {value: 1, min: -10, max: 10}
  s: {value: 0.1, min: 0.0001, max: 5}
  e: {value: 0.1, min: 0.001, max: 2}
inputs: {u: {}}
outputs: {y: {equals: x}}
dynamics: {x: v, v: "mu*(1 - x^2)*v - om^2*x + g*u"}
noise: {process: {kind: density, sd: {v: s}}, measurement: {sd: {y: e}}}
initial: {mean: {x: 0, v: 0}, sd: {x: 1, v: 1}}
""", dict(mu=1.5, om=2, g=2, s=0.3, e=0.15), [("mu*(1 - x^2)*v", "-mu*v")]),
    "house": ("""time: {kind: continuous, column: t, unit: h}
states: {Ti: degC, Tw: degC}
parameters:
  R1: {value: 0.005 K/W, min: 1e-5, max: 0.1}
  R2: {value: 0.005 K/W, min: 1e-5, max: 0.1}
  Ci: {value: 1 MJ/K, min: 0.1, max: 1000}
  Cw: {value: 10 MJ/K, min: 0.1, max: 1000}
  s: {value: 1e-3, min: 1e-6, max: 0.1}
  e: {value: 0.1 K, min: 0.001, max: 2}
inputs: {Ta: {column: Ta, unit: degC}, P: {column: u, unit: W}}
outputs: {T: {column: y, unit: degC, equals: Ti}}
dynamics: {Ti: (Tw - Ti)/(R1*Ci) + P/Ci, Tw: (Ti - Tw)/(R1*Cw) + (Ta - Tw)/(R2*Cw)}
noise: {process: {kind: density, sd: {Ti: s, Tw: s}}, measurement: {sd: {T: e}}}
initial: {mean: {Ti: 20 degC, Tw: 15 degC}, sd: {Ti: 5 K, Tw: 5 K}}
""", dict(R1=0.002, R2=0.008, Ci=3, Cw=20, s=5e-4, e=0.08), [
        ("(Tw - Ti)/(R1*Ci) + P/Ci, Tw: (Ti - Tw)/(R1*Cw) + (Ta - Tw)/(R2*Cw)", "(Ta - Ti)/(R2*Ci) + P/Ci"), (", Tw: degC", ""),
        (", Tw: s", ""), (", Tw: 15 degC", ""), (", Tw: 5 K", ""), ("  R1: {value: 0.005 K/W, min: 1e-5, max: 0.1}\n", ""),
        ("  Cw: {value: 10 MJ/K, min: 0.1, max: 1000}\n", "")]),
    "epidemic": ("""time: {kind: continuous, column: t, unit: d}
states: [S, I]
parameters:
  beta: {value: 0.5 1/d, min: 0.01, max: 5}
  gam: {value: 0.2 1/d, min: 0.01, max: 2}
  I0: {value: 0.001, min: 1e-6, max: 0.1}
  e: {value: 0.2, min: 0.001, max: 2}
outputs: {cases: {column: y, equals: "beta*S*I*1e5*86400", transform: log}}
dynamics: {S: -beta*S*I, I: beta*S*I - gam*I}
noise: {measurement: {sd: {cases: e}}}
initial: {mean: {S: 1 - I0, I: I0}}
""", dict(beta=0.4, gam=0.15, I0=3e-4, e=0.12), [(" - gam*I", ""), ("  gam: {value: 0.2 1/d, min: 0.01, max: 2}\n", "")]),
}


def moved(f, x, u, dt, sd, rng, steps=20):
    """States at every row: Runge-Kutta, and noise of density sd between its steps."""
    x, out, h = np.array(x, float), [np.array(x, float)], dt / steps
    for now in u[:-1]:
        for _ in range(steps):
            a = f(x, now)
            b = f(x + h / 2 * a, now)
            c = f(x + h / 2 * b, now)
            x = x + h / 6 * (a + 2 * b + 2 * c + f(x + h * c, now)) + np.sqrt(h) * np.array(sd) * rng.normal(size=len(x))
        out.append(x.copy())
    return np.array(out)


def recording(name, seed):
    """Columns of one recording."""
    rng, p = np.random.default_rng(seed), dict(MODELS[name][1])
    if name == "motor":
        u = np.repeat(rng.choice([-1, -0.5, 0, 0.5, 1], 60), 25)
        x = moved(lambda x, u: np.array([x[1], p["k"] * u - p["b"] * x[1] - p["c"] * np.tanh(x[1] / 0.2)]), [0, 0], u, 0.02, [0, p["sw"]], rng)
        return dict(t=0.02 * np.arange(len(u)), u=u, y=x[:, 0] + p["se"] * rng.normal(size=len(u)))
    if name == "reservoir":
        level, u = 3.0, np.zeros(900)
        for k in range(len(u)):
            level = 0.97 * level + 0.09 + 0.35 * rng.normal()
            u[k] = np.exp(0.9 * level)
        x = moved(lambda x, u: np.array([(u - p["c"] * max(x[0] - p["sill"], 0) ** 1.5) / (1e6 * p["area"])]), [1.2], u, 3600.0, [p["s"]], rng)
        y = x[:, 0] + p["e"] * rng.normal(size=len(u))
        y[rng.random(len(u)) < 0.1] = np.nan
        return dict(t=np.arange(len(u)), u=u, y=y)
    if name == "oscillator":
        u = np.repeat(rng.normal(size=60), 20)
        x = moved(lambda x, u: np.array([x[1], p["mu"] * (1 - x[0] ** 2) * x[1] - p["om"] ** 2 * x[0] + p["g"] * u]), [0.5, 0], u, 0.05, [0, p["s"]], rng)
        return dict(t=0.05 * np.arange(len(u)), u=u, y=x[:, 0] + p["e"] * rng.normal(size=len(u)))
    if name == "house":
        t = 0.5 * np.arange(1000)
        Ta = 5 + 6 * np.sin(2 * np.pi * t / 24) + 0.06 * np.cumsum(rng.normal(size=len(t)))
        P = np.where(rng.random(len(t)) < 0.05, 1, 0).cumsum() % 2 * 3000.0
        Ci, Cw = 1e6 * p["Ci"], 1e6 * p["Cw"]
        x = moved(lambda x, u: np.array([(x[1] - x[0]) / (p["R1"] * Ci) + u[1] / Ci, (x[0] - x[1]) / (p["R1"] * Cw) + (u[0] - x[1]) / (p["R2"] * Cw)]),
                  [19, 14], np.array([Ta, P]).T, 1800.0, [p["s"], p["s"]], rng)
        return dict(t=t, Ta=Ta, u=P, y=x[:, 0] + p["e"] * rng.normal(size=len(t)))
    u = np.zeros(80)
    x = moved(lambda x, u: np.array([-p["beta"] * x[0] * x[1], p["beta"] * x[0] * x[1] - p["gam"] * x[1]]), [1 - p["I0"], p["I0"]], u, 1.0, [0, 0], rng)
    return dict(t=np.arange(80), y=p["beta"] * 1e5 * x[:, 0] * x[:, 1] * np.exp(p["e"] * rng.normal(size=80)))


def tuned(tool, model, data):
    run = subprocess.run([tool, "tune", model, data, "--method", "ml", "--json", "--quiet"], capture_output=True, text=True)
    try:
        return json.loads(run.stdout)
    except ValueError:
        sys.exit(f"{model}: exit {run.returncode}\n{run.stderr[-400:]}")


def main():
    tool, count = str(pathlib.Path(sys.argv[1]).resolve()), int(sys.argv[2]) if len(sys.argv) > 2 else 20
    print(f"{'system':12}{'complete: ok':>14}{'outside 95 %':>16}{'a term missing: ok':>20}")
    with tempfile.TemporaryDirectory() as scratch:
        folder = pathlib.Path(scratch)
        for name, (text, truth, changes) in MODELS.items():
            lacking = text
            for before, after in changes:
                lacking = lacking.replace(before, after)
            for file, content in ((f"{name}.yaml", text), (f"less_{name}.yaml", lacking)):
                (folder / file).write_text(HEAD.format(name) + content)
            ok = outside = wrong = 0
            for seed in range(count):
                columns = recording(name, seed)
                data = folder / "data.csv"
                with data.open("w", newline="") as file:
                    writer = csv.writer(file)
                    writer.writerow(columns)
                    writer.writerows(["" if v != v else f"{v:.9g}" for v in row] for row in zip(*columns.values()))
                result = tuned(tool, folder / f"{name}.yaml", data)
                if result["status"]["code"] == "ok":
                    ok += 1
                    for p in result["parameters"]:
                        low, high = p["ci95"]
                        outside += p["name"] in truth and not (low or 0) <= truth[p["name"]] <= (np.inf if high is None else high)
                wrong += tuned(tool, folder / f"less_{name}.yaml", data)["status"]["code"] == "ok"
            print(f"{name:12}{ok:7} of {count:3}{outside:9} of {ok * len(truth):3}{wrong:13} of {count:3}", flush=True)


if __name__ == "__main__":
    main()
