#!/usr/bin/env python3
"""The sets of DaISy (De Moor et al.): first half estimates, order automatic, second half simulated from a state of its first 50 rows.

    tests/bench/daisy.py build/identikal FOLDER    # FOLDER: daisy_NAME.csv, columns u1.., y1..

Channels are scaled and centred over the whole file, as whoever made the anchors did. Prints the fit in %, mean over outputs, beside that of
Octave-control 3.4's n4sid (SLICOT) at the order of 12 that turned out best, and processor time. Needs numpy."""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np

# The first eight were at hand when the rules were made; the others showed what was wrong with them.
ANCHORS = {"robot_arm": 95.6, "dryer": 89.0, "cstr": 88.2, "CD_player_arm": 70.3, "glassfurnace": 58.4, "winding": 54.2,
           "thermic_res_wall": 83.9, "steamgen": None, "ballbeam": 14.5, "evaporator": 58.6, "exchanger": 60.9, "flutter": 53.4,
           "heating_system": 88.3, "powerplant": 51.7, "dryer2": 18.6, "pHdata": -30.1}


def simulated(model, u, x):
    A, B, C, D = model
    out = np.empty((len(u), len(C)))
    for t, now in enumerate(u):
        out[t] = C @ x + D @ now
        x = A @ x + B @ now
    return out


def first_state(model, u, y):
    A, _, C, _ = model
    rest, rows, power = y - simulated(model, u, np.zeros(len(A))), [], C
    for _ in range(len(u)):
        rows.append(power)
        power = power @ A
    return np.linalg.lstsq(np.vstack(rows), rest.ravel(), rcond=None)[0]


def matrices(found, inputs, outputs):
    n = len(found["filter"]["A"])
    shapes = {"A": (n, n), "B": (n, inputs), "C": (outputs, n), "D": (outputs, inputs)}
    return [np.array(found["filter"][name], float).reshape(shape) for name, shape in shapes.items()]


def judged(program, u, y, names):
    half, inputs = len(u) // 2, u.shape[1]
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "half.csv"
        np.savetxt(path, np.hstack([u, y])[:half], delimiter=",", header=",".join(names), comments="", fmt="%.12g")
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        run = subprocess.run([program, "model", path, "--input", ",".join(names[:inputs]), "--output", ",".join(names[inputs:]),
                              "--json"], capture_output=True, text=True, check=False)
        seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    found = json.loads(run.stdout)
    at = np.array([each["value"] for each in found["black_box"]["operating_point"]])
    u, y, model = u[half:] - at[:inputs], y[half:] - at[inputs:], matrices(found, inputs, y.shape[1])
    left = y - simulated(model, u, first_state(model, u[:50], y[:50]))
    fit = 100 * (1 - np.sqrt((left ** 2).sum(0) / ((y - y.mean(0)) ** 2).sum(0)))
    return found, fit, np.abs(np.linalg.eigvals(model[0])).max(), seconds


def main(program, folder):
    total, of_anchors = 0.0, 0.0
    for name, anchor in ANCHORS.items():
        path = pathlib.Path(folder) / f"daisy_{name}.csv"
        if not path.exists():
            continue
        names = path.open().readline().strip().split(",")
        data = np.loadtxt(path, delimiter=",", skiprows=1)
        data = (data - data.mean(0)) / data.std(0)
        inputs = sum(each.startswith("u") for each in names)
        found, fit, radius, seconds = judged(program, data[:, :inputs], data[:, inputs:], names)
        box = found["black_box"]
        print(f"{name:17} order {box['order']:2} by {box['refinement']:16} fit {fit.mean():5.1f}  anchor {anchor or '-':>5}  "
              f"radius {radius:.4f}  {seconds:.2f} s  {found['status']['code']}")
        if anchor:
            total, of_anchors = total + fit.mean(), of_anchors + anchor
    print(f"sum of those with an anchor {total:.1f}, of the anchors {of_anchors:.1f}")


if __name__ == "__main__":
    main(*sys.argv[1:])
