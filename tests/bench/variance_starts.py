#!/usr/bin/env python3
"""Do the default starts of `tune` find the greatest likelihood of variances that may be zero?

    variance_starts.py TOOL COUNT [FIRST]

One to three levels under recordings that are none: white noise, autoregressions, noise that changes its size, wild samples, random walks;
or a level with a slope. From a file's small variances the likelihood often has a maximum where a level stands still and a higher one
where it wanders. Prints each recording whose default ends more than 0.01 below the best of 40 starts, and how many do.
"""
import pathlib
import re
import subprocess
import sys
import tempfile

import numpy

TREND = """identikal: 1
time: {step: 1 s}
parameters: {ql: {value: 1e-3, min: 0}, qs: {value: 1e-5, min: 0}, r: {value: 1, min: 0}}
A: [[1, 1], [0, 1]]
C: [[1, 0]]
Q: [[ql, 0], [0, qs]]
R: [[r]]
initial: diffuse
outputs: [{name: y0, column: y0}]
"""


def channel(random, rows):
    kind, e = random.integers(5), random.normal(size=rows)
    if kind == 1:
        pole = random.uniform(0.2, 0.8)
        for t in range(1, rows):
            e[t] += pole * e[t - 1]
    elif kind == 2:
        e = numpy.cumsum(e) * 10 ** random.uniform(-3, 0) + random.normal(size=rows)
    elif kind == 3:
        e = e * numpy.where(numpy.arange(rows) > rows / 2, 3, 0.5)
    elif kind == 4:
        e = e + numpy.where(random.random(rows) < 0.02, 10 * random.normal(size=rows), 0)
        e = e + numpy.cumsum(random.normal(size=rows)) * 10 ** random.uniform(-3, -1)
    return e


def diagonal(entries):
    return "[" + ", ".join("[" + ", ".join(e if i == j else "0" for j in range(len(entries))) + "]" for i, e in enumerate(entries)) + "]"


def levels(count):
    names = range(count)
    parameters = ", ".join(f"q{i}: {{value: 1e-6, min: 0}}, r{i}: {{value: 0.01, min: 0}}" for i in names)
    outputs = ", ".join(f"{{name: y{i}, column: y{i}}}" for i in names)
    one = diagonal(["1"] * count)
    return (f"identikal: 1\ntime: {{step: 1 s}}\nparameters: {{{parameters}}}\nA: {one}\nC: {one}\nQ: {diagonal([f'q{i}' for i in names])}\n"
            f"R: {diagonal([f'r{i}' for i in names])}\ninitial: diffuse\noutputs: [{outputs}]\n")


def log_likelihood(tool, folder, *options):
    run = subprocess.run([tool, "tune", folder / "m.yaml", folder / "d.csv", "--quiet", *options], capture_output=True, text=True, check=False)
    return float(re.search(r"log-likelihood (\S+)", run.stdout)[1])


def main():
    tool, count, first = sys.argv[1], int(sys.argv[2]), int(sys.argv[3]) if len(sys.argv) > 3 else 0
    short = 0
    with tempfile.TemporaryDirectory() as made:
        folder = pathlib.Path(made)
        for seed in range(first, first + count):
            random = numpy.random.default_rng(seed)
            channels, rows = int(random.integers(1, 4)), int(random.choice([150, 400, 1000]))
            y = numpy.array([channel(random, rows) for _ in range(channels)])
            slope = random.random() < 0.3 and channels == 1
            (folder / "m.yaml").write_text(TREND if slope else levels(channels))
            numpy.savetxt(folder / "d.csv", y.T, delimiter=",", header=",".join(f"y{i}" for i in range(channels)), comments="")
            behind = log_likelihood(tool, folder) - log_likelihood(tool, folder, "--starts", "40")
            if not behind > -0.01:
                short += 1
                print(f"{seed}: {channels} channels, {rows} rows: {behind:.2f}", flush=True)
    print(f"{short} of {count} below the best of 40 starts")


if __name__ == "__main__":
    main()
