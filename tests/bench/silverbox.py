#!/usr/bin/env python3
"""The Silverbox benchmark (Wigren & Schoukens 2013) with its spring as a function that nobody knows: a mass, a damper, a spline.

    tests/bench/silverbox.py build/identikal FOLDER [ROWS [smooth]]   # FOLDER has silverbox.csv: columns u and y in V, 610.35 Hz

Estimates from rows [40650, 105712), or the first ROWS of them, from a linear spring on; then simulates freely the multisine test [105712, 127400), the
arrow [100, 40575) and the arrow without extrapolation [100, 32100). The first 50 rows of each tell the initial state alone. With `smooth` the spline has 13 knots and
is as smooth as these rows ask for. Prints the error of the simulations [mV] behind them, beside the published figures of GRU and OLSTM networks."""
import json
import math
import pathlib
import resource
import subprocess
import sys
import tempfile

SMOOTH = "smooth" in sys.argv
KNOTS = [round(-0.3 + 0.05 * k, 3) for k in range(13)] if SMOOTH else [-0.3, -0.2, -0.1, 0.0, 0.1, 0.2, 0.3]
TESTS = {"multisine": (105712, 127400, "1.49, 1.52"), "arrow": (100, 40575, "2.80, 2.39"), "arrow without extrapolation": (100, 32100, "0.95, 1.08")}


def model(values, free):
    """The model file; only parameters of these names are free."""
    fixed = {name: "" if name in free else ", fixed: true" for name in values}
    parameters = "\n".join(f"  {name}: {{value: {value!r}{fixed[name]}{', min: 1e-6' if name == 's' else ''}}}" for name, value in values.items())
    return f"""identikal: 1
states: [x, v]
inputs: [{{name: u}}]
time: {{step: 1.6384 ms, kind: continuous, inputs: foh}}
parameters:
{parameters}
let:
  spring: {{spline: x, knots: {KNOTS}{", smooth: true" if SMOOTH else ""}}}
dynamics: {{x: v, v: b*u - d*v - spring}}
outputs: {{y: {{column: y, equals: x}}}}
noise: {{measurement: {{sd: {{y: s}}}}}}
initial: {{mean: {{x: x0, v: v0}}}}
"""


def run(program, *arguments):
    done = subprocess.run([program, *map(str, arguments)], capture_output=True, text=True, check=False)
    if done.returncode not in (0, 1, 3):
        sys.exit(done.stderr)
    return done.stdout


def fitted(program, folder, values, free, rows, *options):
    (folder / "model.yaml").write_text(model(values, free))
    (folder / "rows.csv").write_text("u,y\n" + "\n".join(rows) + "\n")
    found = json.loads(run(program, "fit", folder / "model.yaml", folder / "rows.csv", "--json", "--starts", "1", *options))
    return {**values, **{each["name"]: each["value"] for each in found["parameters"] if each["name"] in values}}, found


def simulation_error(program, folder, values, rows):
    """mV behind the first 50 rows, which tell x0 and v0."""
    values = {**values, "x0": float(rows[0].split(",")[1]), "v0": 0.0}
    values, _ = fitted(program, folder, values, ("x0", "v0"), rows[:50])
    (folder / "model.yaml").write_text(model(values, ()))
    (folder / "rows.csv").write_text("u,y\n" + "\n".join(rows) + "\n")
    run(program, "filter", folder / "model.yaml", folder / "rows.csv", "-o", folder / "out")
    lines = (folder / "out/predictions.csv").read_text().splitlines()
    place = next(i for i, name in enumerate(lines[0].split(",")) if name.startswith("y"))
    errors = [float(line.split(",")[place]) - float(row.split(",")[1]) for line, row in zip(lines[1:], rows)][50:]
    return 1000 * math.sqrt(sum(e * e for e in errors) / len(errors))


def main(program, shared, count=65062, *_):
    data = (pathlib.Path(shared) / "silverbox.csv").read_text().split()[1:]
    values = {"d": 40.0, "b": 1.7e5, "s": 0.003, "x0": 0.0, "v0": 0.0} | {f"spring_{i + 1}": 1.7e5 * knot for i, knot in enumerate(KNOTS)}
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        for rows in (min(3000, int(count)), int(count)):
            values, found = fitted(program, folder, values, tuple(values), data[40650:40650 + rows])
            print(f"estimated from {rows} rows: rmse {1000 * values['s']:.3f} mV, {found['status']['code']}", flush=True)
        print({name: float(f"{value:.6g}") for name, value in values.items()})
        for name, (first, last, published) in TESTS.items():
            print(f"{name:28} {simulation_error(program, folder, values, data[first:last]):.2f} mV   GRU, OLSTM: {published}", flush=True)
    print(f"{resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime:.0f} s of processor time")


if __name__ == "__main__":
    main(*sys.argv[1:])
