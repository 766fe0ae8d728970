#!/usr/bin/env python3
"""`model` at both ends: a recording that is long, and recordings that are short.

    tests/bench/black_box_extremes.py build/identikal long           # a million rows, three inputs and outputs, orders 1 to 20: seconds
    tests/bench/black_box_extremes.py build/identikal short COUNT [STATES]  # 200 rows at 10 dB: impulse responses against the true ones

`short` prints the fit, in %, of the impulse response by kernels, of that of the state-space model of least BIC and of the output-error model of
least BIC (orders 1 to 10), over 51 rows, and how often the kernels' 95 % bands hold the truth. Systems have 2 to 10 states, or so many (30 in
the literature, where poles lie within 0.95). Needs numpy."""
import json
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np
from random_systems import random_matrix_of_poles, random_system, recorded


def run(program, u, y, *options):
    names = [f"u{i}" for i in range(u.shape[1])] + [f"y{i}" for i in range(y.shape[1])]
    with tempfile.TemporaryDirectory() as folder:
        path = pathlib.Path(folder) / "log.csv"
        np.savetxt(path, np.hstack([u, y]), delimiter=",", header=",".join(names), comments="", fmt="%.8g")
        before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
        done = subprocess.run([program, "model", path, "--input", ",".join(names[:u.shape[1]]), "--output", ",".join(names[u.shape[1]:]),
                               "--json", *options], capture_output=True, text=True, check=False)
    return json.loads(done.stdout), resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before


def long(program):
    draw = np.random.default_rng(5)
    u, y = recorded(draw, random_system(draw, 6, 3, 3, 20), 1_000_000, np.zeros((3, 3)))
    found, seconds = run(program, u, y, "--order", "1:20")
    print(f"order {found['black_box']['order']} of 6, {seconds:.1f} s of processor time, {found['status']['code']}")


def responses(A, B, C, D, rows):
    out, x = [float(D)], B
    for _ in range(rows):
        out.append((C @ x).item())
        x = A @ x
    return np.array(out)


def fit_of(found, truth, scale):
    steady, size = found["filter"], found["black_box"]["order"]
    a, b, c = (np.array(steady[name], float).reshape(shape) for name, shape in (("A", (size, size)), ("B", (size, 1)), ("C", (1, size))))
    return 100 * (1 - np.linalg.norm(responses(a, b, c, steady["D"][0][0], len(truth) - 1) - truth) / scale)


def short(program, count, states=None):
    draw, kernels, models, errors, covered, chosen = np.random.default_rng(7), [], [], [], [], {}
    for _ in range(int(count)):
        n = draw.integers(2, 11) if states is None else int(states)
        A, B, C = random_matrix_of_poles(draw, n), draw.standard_normal((n, 1)), draw.standard_normal((1, n))
        u, truth = draw.standard_normal((200, 1)), responses(A, B, C, 0.0, 200)
        y = np.convolve(u[:, 0], truth)[:200, None]
        y += draw.standard_normal((200, 1)) * y.std() / np.sqrt(10)
        found, _ = run(program, u, y, "--for", "prediction")
        output_error, _ = run(program, u, y, "--as", "oe", "--order", "1:10")
        (response,) = found["black_box"]["impulse_responses"]
        chosen[response["kernel"]] = chosen.get(response["kernel"], 0) + 1
        value, se = np.array(response["value"]), np.array(response["se"])
        rows = min(len(value), 51)
        truth = truth[:rows]
        scale = np.linalg.norm(truth - truth.mean())
        kernels.append(100 * (1 - np.linalg.norm(value[:rows] - truth) / scale))
        models.append(fit_of(found, truth, scale))
        errors.append(fit_of(output_error, truth, scale))
        covered.append(np.mean(np.abs(value[:rows] - truth) < 1.96 * se[:rows]))
    print(f"{count} systems: fit by kernels {np.mean(kernels):.1f} {chosen}, of the model of least BIC {np.mean(models):.1f}, of the output-error model "
          f"of least BIC {np.mean(errors):.1f} (medians {np.median(kernels):.1f}, {np.median(models):.1f}, {np.median(errors):.1f}), kernels better than that "
          f"in {np.mean(np.array(kernels) > errors):.2f}, bands hold {np.mean(covered):.3f}")


if __name__ == "__main__":
    {"long": long, "short": short}[sys.argv[2]](sys.argv[1], *sys.argv[3:])
