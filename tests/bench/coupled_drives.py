#!/usr/bin/env python3
"""Coupled electric drives (Wigren & Schoukens 2017): a sensor that measures the size of a speed, and a drive that nobody knows.

    tests/bench/coupled_drives.py build/identikal FOLDER   # FOLDER has ced_prbs_1.csv to ced_prbs_3.csv: columns u and y, 20 ms

A lag, a belt that swings, the amount of its speed; the drive a spline over the voltage, for all three records at once. The first 400 rows of each
estimate, the last 100 are simulated from a start that they tell themselves. Prints the errors there."""
import json
import pathlib
import subprocess
import sys
import tempfile

MODEL = """identikal: 1
states: [m, w, v]
inputs: [{name: u}]
parameters:
  tau: {value: 0.3, min: 0.01, max: 5}
  k: {value: 300, min: 10, max: 5000}
  c: {value: 5, min: 0}
  s: {value: 0.1, min: 1e-4}
time: {kind: continuous, step: 20 ms}
let: {drive: {spline: u, knots: [-1.5, -1, -0.5, 0.5, 1, 1.5], values: [-3, -2, -1, 1, 2, 3]}}
dynamics: {m: (drive - m)/tau, w: v, v: k*(m - w) - c*v}
outputs: {y: {column: y, equals: abs(w)}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {m: 0.5, w: 0.5, v: 0}, sd: {m: 2, w: 2, v: 10}}
"""


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 3):
        sys.exit(done.stderr)
    return done.stdout


def main(program, shared):
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        (folder / "model.yaml").write_text(MODEL)
        for record in (1, 2, 3):
            rows = (pathlib.Path(shared) / f"ced_prbs_{record}.csv").read_text().splitlines()
            (folder / f"first_{record}.csv").write_text("\n".join(rows[:401]) + "\n")
            (folder / f"last_{record}.csv").write_text("\n".join([rows[0], *rows[-100:]]) + "\n")
        print(run(program, "fit", folder / "model.yaml", *(folder / f"first_{record}.csv" for record in (1, 2, 3)), "--objective", "simulation",
                  "-o", folder / "out"))
        for record in (1, 2, 3):
            judged = json.loads(run(program, "validate", folder / "out", folder / f"last_{record}.csv", "--json"))
            print(f"record {record}: error of the simulation of its last 100 rows {judged['fit']['simulation']['y']['rmse']:.3f}, "
                  f"fit {judged['fit']['simulation']['y']['fit_percent']:.1f} %")


if __name__ == "__main__":
    main(*sys.argv[1:])
