#!/usr/bin/env python3
"""Does `model` say where a linear model is not enough, and only there?

    nonlinear_systems.py TOOL COUNT

Simulated systems of order 1 to 4, 1000 to 8000 rows, four kinds of inputs, white and coloured noise: linear ones (with heavy tails,
and louder where the input is, too; and fitted as output error in strongly coloured noise), and such with a curve before them, behind them or within. Prints how often a curve was named
and how often in its place.
"""
import json
import subprocess
import sys
import tempfile

import numpy

OUTPUT_ERROR = "linear, as output error"
# What acts where: before the system, where it is measured, back on its input.
KINDS = {
    "linear": None, "linear, heavy tails": None, "linear, louder with the input": None, OUTPUT_ERROR: None,
    "square of the input": "input", "saturation": "input", "dead zone": "input",
    "square of the output": "output", "spring": "feedback",
}


def system(random, order):
    poles = []
    while len(poles) < order:
        if order - len(poles) >= 2 and random.random() < 0.6:
            pole = random.uniform(0.5, 0.97) * numpy.exp(1j * random.uniform(0.05, 1.5))
            poles += [pole, numpy.conj(pole)]
        else:
            poles.append(random.uniform(0.2, 0.97))
    A = numpy.eye(order, k=-1)
    A[0] = -numpy.real(numpy.poly(poles))[1:]
    return A, numpy.eye(order)[0], random.normal(size=order)


def simulated(A, B, C, u, force=lambda z: 0.0):
    x, y = numpy.zeros(len(B)), numpy.zeros(len(u))
    for t, value in enumerate(u):
        y[t] = C @ x
        x = A @ x + B * (value + force(y[t]))
    return y


def driven(random, rows):
    t = numpy.arange(rows)
    kind = random.integers(4)
    if kind == 0:
        return random.normal(size=rows)
    if kind == 1:
        sign = numpy.where(numpy.convolve(random.normal(size=rows + 5), numpy.ones(6), "valid") > 0, 1.0, -1.0)
        return sign * random.uniform(0.5, 1.5, rows // 50 + 1)[t // 50]
    if kind == 2:
        return sum(numpy.sin(w * t + random.uniform(0, 6.28)) for w in random.uniform(0.01, 1.5, 12)) / 3
    return random.uniform(-1.7, 1.7, rows // 20 + 1)[t // 20]


def noise_of(random, kind, u):
    e = random.standard_t(4, size=len(u)) if kind == "linear, heavy tails" else random.normal(size=len(u))
    ratio = random.choice([3, 10, 30])
    if random.random() < 0.5:
        pole = random.uniform(0.5, 0.95)
        for t in range(1, len(e)):
            e[t] += pole * e[t - 1]
        e /= e.std()
    return e / ratio * (1 + 0.8 * numpy.abs(u) if kind == "linear, louder with the input" else 1.0)


def in_coloured_noise(random, rows=800):
    """(0.5 q^-1 + 0.3 q^-2) / (1 - 1.5 q^-1 + 0.7 q^-2) u, and an autoregression of 0.9."""
    u, e, y, v = random.normal(size=rows), 0.3 * random.normal(size=rows), numpy.zeros(rows), numpy.zeros(rows)
    for t in range(2, rows):
        y[t] = 0.5 * u[t - 1] + 0.3 * u[t - 2] + 1.5 * y[t - 1] - 0.7 * y[t - 2]
        v[t] = 0.9 * v[t - 1] + e[t]
    return u, y + v


def recording(kind, seed):
    random = numpy.random.default_rng(seed)
    if kind == OUTPUT_ERROR:
        return in_coloured_noise(random)
    rows = int(random.choice([1000, 3000, 8000]))
    A, B, C = system(random, random.integers(1, 5))
    u = driven(random, rows)
    C = C / simulated(A, B, C, u).std()
    noise = noise_of(random, kind, u)
    inputs = {"square of the input": u + 0.3 * u * u, "saturation": numpy.clip(u, -1, 1),
              "dead zone": numpy.sign(u) * numpy.maximum(numpy.abs(u) - 0.4, 0)}.get(kind, u)
    spring = (lambda z: -0.1 * z**3 if abs(z) < 4 else 0.0) if kind == "spring" else (lambda z: 0.0)
    y = simulated(A, B, C, inputs, spring)
    if kind == "square of the output":
        y = y + 0.2 * y * y
    return u, y + noise


def main():
    tool, count = sys.argv[1], int(sys.argv[2])
    print(f"{'system':<32} {'named':>7} {'serious':>8} {'in its place':>13} {'ok':>5}   of {count}")
    for number, (kind, place) in enumerate(KINDS.items()):
        named = serious = right = ok = 0
        for k in range(count):
            u, y = recording(kind, 10000 * number + k)
            with tempfile.NamedTemporaryFile("w", suffix=".csv") as file:
                numpy.savetxt(file, numpy.c_[u, y], delimiter=",", header="u,y", comments="")
                file.flush()
                options = ["--as", "oe", "--order", "2", "--delay", "1"] if kind == OUTPUT_ERROR else []
                run = subprocess.run([tool, "model", file.name, "--input", "u", "--output", "y", "--json", "--quiet", *options],
                                     capture_output=True, text=True, check=False)
            result = json.loads(run.stdout)
            findings = [w for w in result["warnings"] if w["code"] == "nonlinear"]
            ok += result["status"]["code"] == "ok"
            if findings:
                named += 1
                serious += findings[0]["severity"] == "serious"
                right += result["black_box"]["nonlinearities"][0]["place"] == place
        print(f"{kind:<32} {named:>7} {serious:>8} {right:>13} {ok:>5}", flush=True)


if __name__ == "__main__":
    main()
