"""How many of 20 starts come to the best simulation, how long does that take, and how well does it hold elsewhere?
nonlinear_starts.py PROGRAM [FOLDER with tanks_estimation.csv and tanks_validation.csv]

Cascaded tanks (Schoukens & Noël 2017): two tanks that drain by a power of their head and overflow, the upper one partly into the lower. The others
are templates of the program, simulated without process noise from the values that they hold, and searched for from starts scattered about others."""
import json
import pathlib
import re
import resource
import subprocess
import sys
import tempfile
import time

PROGRAM, STARTS = sys.argv[1], 20
TANKS = """identikal: 1
name: cascaded tanks with overflow
time: {kind: continuous, step: 4 s}
parameters:
  s: 1 1/s
  k1: {value: 0.05 1/s, min: 0.001, max: 0.5}
  k3: {value: 0.05 1/s, min: 0.001, max: 0.5}
  k4: {value: 0.05 1/s, min: 0.001, max: 0.5}
  share: {value: 0.5, min: 0, max: 1}
  n1: {value: 0.5, min: 0.2, max: 1.2}
  n2: {value: 0.5, min: 0.2, max: 1.2}
  d1: {value: 0, min: -3, max: 10}
  d2: {value: 0, min: -3, max: 10}
  a: {value: 1, min: 0.1, max: 5}
  r: {value: 0.001, min: 1e-6}
states: {h1: 1, h2: 1}
inputs: {u: {column: u, unit: 1}}
let:
  over1: s*max(h1 - 10, 0)
  over2: s*max(h2 - 10, 0)
  flow: k1*pow(max(h1 + d1, 1e-6), n1)
dynamics:
  h1: k4*u - flow - over1
  h2: a*flow - k3*pow(max(h2 + d2, 1e-6), n2) + share*over1 - over2
outputs: {y: {column: y, unit: 1, equals: h2}}
noise: {measurement: {variance: {y: r}}}
initial: {mean: {h1: 5, h2: 5}, sd: {h1: 3, h2: 3}}
"""


def run(*arguments):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)


def fit(name, model, log, folder):
    before, begin = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime, time.time()
    run("fit", model, log, "--objective", "simulation", "--starts", STARTS, "-o", folder)
    wall, processor = time.time() - begin, resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    found = json.loads((folder / "result.json").read_text())
    of = found["objective"]
    rmse = next(iter(found["fit"]["simulation"].values()))["rmse"]
    print(f"{name:<10} {of['starts_at_optimum']:>2} of {of['starts']} starts  {wall:5.1f} s ({processor:5.1f} s of processor)  rmse {rmse:.4g}  {found['status']['code']}")


with tempfile.TemporaryDirectory() as made:
    here = pathlib.Path(made)
    if len(sys.argv) > 2:
        data = pathlib.Path(sys.argv[2])
        (here / "tanks.yaml").write_text(TANKS)
        fit("tanks", here / "tanks.yaml", data / "tanks_estimation.csv", here / "tanks")
        other = json.loads(run("validate", here / "tanks", data / "tanks_validation.csv", "--json").stdout)
        print(f"           test record: rmse {next(iter(other['fit']['simulation'].values()))['rmse']:.3f} V")
    for template in ("pendulum", "battery", "tanks", "mass-spring-damper"):
        text = run("init", template).stdout
        model = here / f"{template}.yaml"
        model.write_text(text)
        inputs = re.search(r"identikal simulate \S+ (.*?) -o demo", text)[1]
        words = [word.strip("'") for word in re.findall(r"'[^']*'|\S+", inputs)]
        run("simulate", model, *words, "--set", "q=0", "-o", here / "demo")
        # Other values to begin at: those that are free, each times 1.6.
        free = [(m[1], float(m[2])) for m in re.finditer(r"^  (\w+): \{value: ([\d.e+-]+)", text, re.M) if m[1] not in ("q", "r")]
        begun = re.sub(r"(?m)^(  (?!q|r)\w+: \{value: )([\d.e+-]+)", lambda m: f"{m[1]}{1.6 * float(m[2]):g}", text)
        model.write_text(begun)
        fit(template, model, here / "demo/simulated.csv", here / template)
        found = json.loads((here / template / "result.json").read_text())
        values = {p["name"]: p for p in found["parameters"]}
        print("           " + ", ".join(f"{name} {values[name]['value']:.5g} ({truth:g})" for name, truth in free))
