#!/usr/bin/env python3
"""What is `smooth: true` worth: a lag with an unknown curve of its input, 400 rows.

    smooth_curves.py TOOL COUNT

The curve (tanh, a straight line, a bump, a dead zone; noise of 0.05 and 0.3) as a spline of 5 knots, of 12, and of 12 that is smooth. Prints the
root mean square error of the curve within 1.8, how often its 95 % band holds the truth there, how many results are ok, and seconds.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import time

import numpy

CURVES = {"tanh": lambda u: numpy.tanh(1.5 * u) + 0.1 * u, "line": lambda u: 0.7 * u + 0.2, "bump": lambda u: numpy.exp(-8 * (u - 0.5) ** 2) + 0.3 * u,
          "dead zone": lambda u: numpy.sign(u) * numpy.maximum(numpy.abs(u) - 0.6, 0)}
MODELS = {"5 knots": (5, ""), "12 knots": (12, ""), "12, smooth": (12, ", smooth: true")}


def model(knots, smooth):
    places = ", ".join(f"{k:g}" for k in numpy.linspace(-2, 2, knots))
    return f"""identikal: 1
states: [x]
inputs: [{{name: u}}]
parameters: {{tau: {{value: 0.5 s, min: 0.05 s, max: 5 s}}, sd: {{value: 0.1, min: 0}}, start: {{value: 0}}}}
time: {{kind: continuous, step: 0.1 s}}
let: {{f: {{spline: u, knots: [{places}]{smooth}}}}}
dynamics: {{x: (f - x)/tau}}
outputs: {{y: {{column: y, equals: x}}}}
noise: {{measurement: {{sd: {{y: sd}}}}}}
initial: {{mean: {{x: start}}}}
"""


def recording(curve, noise, seed, rows=400, step=0.1, tau=0.8):
    random = numpy.random.default_rng(seed)
    u = numpy.repeat(numpy.clip(random.normal(0, 0.9, rows // 4), -1.95, 1.95), 4)
    x, y, stays = 0.0, numpy.zeros(rows), numpy.exp(-step / tau)
    for t in range(rows):
        y[t] = x
        x = stays * x + (1 - stays) * curve(u[t])
    return numpy.c_[step * numpy.arange(rows), u, y + noise * random.normal(size=rows)]


def fitted(tool, folder, curve):
    begin = time.time()
    run = subprocess.run([tool, "fit", folder / "m.yaml", folder / "d.csv", "--json", "--quiet"], capture_output=True, text=True, check=False)
    result = json.loads(run.stdout)
    found = result["curves"][0]
    at, value, se = (numpy.array(found[key], float) for key in ("at", "value", "se"))
    off, inside = value - curve(at), numpy.abs(at) < 1.8
    return (numpy.sqrt(numpy.mean(off[inside] ** 2)), numpy.mean(numpy.abs(off[inside]) < 1.96 * se[inside]), result["status"]["code"] == "ok",
            time.time() - begin)


def main():
    tool, count = sys.argv[1], int(sys.argv[2])
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        for name, curve in CURVES.items():
            for noise in (0.05, 0.3):
                for label, (knots, smooth) in MODELS.items():
                    (folder / "m.yaml").write_text(model(knots, smooth))
                    rows = []
                    for seed in range(100, 100 + count):
                        numpy.savetxt(folder / "d.csv", recording(curve, noise, seed), delimiter=",", header="time [s],u,y", comments="")
                        rows.append(fitted(tool, folder, curve))
                    error, held, ok, seconds = numpy.mean(numpy.array(rows, float), axis=0)
                    print(f"{name:10} noise {noise:<5} {label:11} error {error:.4f}  band holds {100 * held:5.1f} %  ok {100 * ok:3.0f} %  {seconds:.2f} s",
                          flush=True)


if __name__ == "__main__":
    main()
