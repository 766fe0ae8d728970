"""What does one likelihood of many recordings cost, and what does a car's model of two real logs?

    python3 tests/bench/joint_fits.py build/identikal [FOLDER]

Cups that cool, of 60 rows with two values of their own each, fixed or drawn from a population. FOLDER holds niki_group5controller.csv and
niki_group10controller.csv: both logs and each alone, whose estimates are set beside each other.
"""
import json
import math
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
FOLDER = pathlib.Path(sys.argv[2]).resolve() if len(sys.argv) > 2 else None
CUPS = """identikal: 1
name: cooling
time: {kind: continuous, step: 20 s}
parameters:
  k: {value: 2e-3 1/s, min: 0, per: recording, spread: 0.3}
  T0: {value: 60, per: recording}
  room: 18
  s: {value: 1, min: 0}
states: [T]
dynamics: {T: -k*(T - room)}
outputs: {y: {column: T, equals: T}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {T: T0}}
"""
CAR = """identikal: 1
name: Niki
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters:
  m: 1776.2 kg
  a: 1.194 m
  b: 1.437 m
  Iz: {value: 3000 kg m^2, min: 300, max: 15000}
  Cf: {value: 1.2e5 N/rad, min: 1e4, max: 1e6}
  Cr: {value: 1.6e5 N/rad, min: 1e4, max: 1e6}
  steer0: {value: 0 rad, per: recording}
  vy0: {value: 0 m/s, per: recording}
  qv: {value: 0.1, min: 0}
  qr: {value: 0.01, min: 0}
  sr: {value: 0.001, min: 0}
  sv: {value: 0.02, min: 0}
states: {vy: m/s, r: rad/s}
inputs:
  steer: {column: roadWheelAngle_rad, unit: rad}
  vx: {column: vxCG_mps, unit: m/s}
let:
  Ff: Cf*(steer + steer0 - (vy + a*r)/vx)
  Fr: -Cr*(vy - b*r)/vx
dynamics:
  vy: (Ff + Fr)/m - vx*r
  r: (a*Ff - b*Fr)/Iz
outputs:
  r: {column: yawRate_radps, unit: rad/s, equals: r}
  vy: {column: vyCG_mps, unit: m/s, equals: vy + vy0}
noise: {process: {kind: density, sd: {vy: qv, r: qr}}, measurement: {sd: {r: sr, vy: sv}}}
initial: {mean: {vy: 0, r: 0}, sd: {vy: 1, r: 1}}
use_when: "vx > 4"
"""


def fitted(*arguments):
    """The result, and the seconds of processor."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    done = subprocess.run([PROGRAM, "fleet", "joint", *map(str, arguments), "--workers", "1", "--json"], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if not done.stdout:
        sys.exit(done.stderr)
    return json.loads(done.stdout), after.ru_utime - before.ru_utime


def cups():
    rng = random.Random(1)
    for i in range(1600):
        k, start = 1e-3 * math.exp(0.2 * rng.gauss(0, 1)), rng.uniform(60, 90)
        pathlib.Path(f"cup{i}.csv").write_text("T\n" + "".join(f"{20 + (start - 20) * math.exp(-k * 20 * t) + 0.5 * rng.gauss(0, 1):.6f}\n" for t in range(60)))
    models = {"each its own": CUPS.replace(", spread: 0.3", ""), "of a population": CUPS}
    for count in (25, 100, 400, 800, 1600):
        pathlib.Path("cups.csv").write_text("recording\n" + "".join(f"cup{i}.csv\n" for i in range(count)))
        for name, model in models.items():
            pathlib.Path("cup.yaml").write_text(model.replace("room: 18", "room: 20"))
            found, seconds = fitted("cup.yaml", "cups.csv", "--starts", "1")
            print(f"{count} recordings, {name}: {seconds:.2f} s, {found['objective']['evaluations']} evaluations, status {found['status']['code']}", flush=True)


def car():
    pathlib.Path("car.yaml").write_text(CAR)
    logs = [FOLDER / f"niki_group{k}controller.csv" for k in (5, 10)]
    for files in (logs, logs[:1], logs[1:]):
        found, seconds = fitted("car.yaml", *files, "--starts", "1")
        shown = ", ".join(f"{p['name'].replace('_niki_group', ' of ').replace('controller', '')} {p['value']:.4g} +- {p['se']:.2g}"
                          for p in found["parameters"] if not p["fixed"] and p["name"][0] not in "qs" or p["name"].startswith("steer0"))
        print(f"{' and '.join(f.stem for f in files)}: {shown}; {seconds:.1f} s, log-likelihood {found['objective']['log_likelihood']:.3f}, status {found['status']['code']}", flush=True)


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    cups()
    if FOLDER:
        car()
