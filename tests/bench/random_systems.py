#!/usr/bin/env python3
"""Random systems with known truth: how far from exact maximum likelihood at the true order does `model` predict rows it has not seen?

    tests/bench/random_systems.py build/identikal COUNT SEED [prediction|automatic|simulation]

n 1 to 8, inputs and outputs 1 to 3, signal to noise 0 to 40 dB, 500 to 20 000 rows, a third in closed loop. Exact maximum likelihood loses
its number of free parameters over the number of measured values on average. Prints every system and a summary: the share within 1 % of that,
orders, coverage of the 95 % intervals of poles and of the 95 % bands of gain over frequency and of steps where the order is the true one, unstable
models, time. Needs numpy."""
import json
import os
import subprocess
import sys
import tempfile
import time

import numpy as np


def random_matrix_of_poles(draw, n):
    A, at = np.zeros((n, n)), 0
    while at < n:
        if n - at >= 2 and draw.random() < 0.6:
            radius, angle = draw.uniform(0.3, 0.97), draw.uniform(0.05, 2.5)
            A[at:at + 2, at:at + 2] = radius * np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
            at += 2
        else:
            A[at, at] = draw.uniform(-0.6, 0.97)
            at += 1
    T = np.linalg.qr(draw.standard_normal((n, n)))[0]
    return T @ A @ T.T


def steady_gain(A, C, Q, R):
    P = np.eye(len(A))
    for _ in range(3000):
        S = C @ P @ C.T + R
        K = A @ P @ C.T @ np.linalg.inv(S)
        P = A @ P @ A.T + Q - K @ S @ K.T
        P = (P + P.T) / 2
    return K, C @ P @ C.T + R


def variance(A, B, C, D, drive):
    x, y = np.zeros(len(A)), np.empty((len(drive), len(C)))
    for t, now in enumerate(drive):
        y[t] = C @ x + D @ now
        x = A @ x + B @ now
    return y[500:].var(0).mean()


def random_system(draw, n, m, p, decibels):
    while True:
        A = random_matrix_of_poles(draw, n)
        B, C = draw.standard_normal((n, m)), draw.standard_normal((p, n))
        D = draw.standard_normal((p, m)) * (draw.random() < 0.3)
        G, root = 0.5 * draw.standard_normal((n, n)), 0.5 * np.tril(draw.standard_normal((p, p))) + np.eye(p)
        K, S = steady_gain(A, C, G @ G.T * draw.uniform(0, 1), root @ root.T)
        if np.abs(np.linalg.eigvals(A - K @ C)).max() < 0.98:
            break
    signal = variance(A, B, C, D, draw.standard_normal((5000, m)))
    noise = variance(A, K, C, np.eye(p), draw.standard_normal((5000, p)) @ np.linalg.cholesky(S).T)
    return A, B, C, D, K, S * signal / noise / 10 ** (decibels / 10)


def recorded(draw, system, rows, feedback):
    A, B, C, D, K, S = system
    m, p = B.shape[1], len(C)
    e, r = draw.standard_normal((rows, p)) @ np.linalg.cholesky(S).T, draw.standard_normal((rows, m))
    u, y, x, before = np.empty((rows, m)), np.empty((rows, p)), np.zeros(len(A)), np.zeros(p)
    for t in range(rows):
        u[t] = r[t] - feedback @ before
        y[t] = C @ x + D @ u[t] + e[t]
        x = A @ x + B @ u[t] + K @ e[t]
        before = y[t]
    return u, y


def error_covariance(A, B, C, D, K, u, y):
    x, e = np.zeros(len(A)), np.empty_like(y)
    for t in range(len(y)):
        e[t] = y[t] - C @ x - D @ u[t]
        x = A @ x + B @ u[t] + K @ e[t]
    return e[50:].T @ e[50:] / (len(e) - 50)


def model_of(program, u, y, purpose):
    names = [f"u{i}" for i in range(u.shape[1])] + [f"y{i}" for i in range(y.shape[1])]
    with tempfile.TemporaryDirectory() as folder:
        path = os.path.join(folder, "log.csv")
        np.savetxt(path, np.hstack([u, y]), delimiter=",", header=",".join(names), comments="", fmt="%.12g")
        begin = time.time()
        run = subprocess.run([program, "model", path, "--input", ",".join(names[:u.shape[1]]), "--output",
                              ",".join(names[u.shape[1]:]), "--json", "--for", purpose], capture_output=True, text=True, check=False)
    if run.returncode > 1:
        sys.exit(f"{run.stderr}of {len(y)} rows, {names}")
    return json.loads(run.stdout), time.time() - begin


def inside(value, se, truth):
    """Share of a band that holds the truth; of what has an error."""
    value, se = np.array(value, float), np.array(se, float)
    return list(np.abs(value - truth)[se > 0] < 1.96 * se[se > 0])


def bands(system, box, m):
    """Whether 95 % bands hold the truth: of the model's gain over frequency and the first 40 rows of its steps, and of the gain by spectral analysis."""
    A, B, C, D, *_ = system
    gains, steps, spectral = [], [], []
    for place, response in enumerate(box["frequency_responses"]):
        i, j = divmod(place, m)
        truth = [abs((C @ np.linalg.solve(np.exp(1j * w) * np.eye(len(A)) - A, B) + D)[i, j]) for w in response["frequency"]]
        gains += inside(response["gain"], response["gain_se"], np.array(truth))
        spectral += inside(response["spectral_gain"], response["spectral_gain_se"], np.array(truth))
    for response in box["step_responses"]:
        i, j = int(response["output"][1:]), int(response["input"][1:])
        x, truth = np.zeros(len(A)), []
        for _ in range(40):
            truth.append(C[i] @ x + D[i, j])
            x = A @ x + B[:, j]
        steps += inside(response["value"][:40], response["se"][:40], np.array(truth))
    return gains, steps, spectral


def main(program, count, seed, purpose="prediction"):
    draw, excess, orders, covered, times, unstable, right = np.random.default_rng(int(seed)), [], [], [], [], 0, 0
    in_gains, in_steps, in_spectral = [], [], []
    for _ in range(int(count)):
        n, m, p = draw.integers(1, 9), draw.integers(1, 4), draw.integers(1, 4)
        decibels, rows = draw.uniform(0, 40), int(10 ** draw.uniform(np.log10(500), np.log10(20000)))
        system = random_system(draw, n, m, p, decibels)
        feedback = draw.standard_normal((m, p)) * 0.2 / np.sqrt(p) * (draw.random() < 0.33)
        u, y = recorded(draw, system, rows, feedback)
        if not np.abs(y).max() < 1e6:
            continue  # the loop is unstable
        found, seconds = model_of(program, u, y, purpose)
        box, steady = found["black_box"], found["filter"]
        size = box["order"]
        shapes = {"A": (size, size), "B": (size, m), "C": (p, size), "D": (p, m), "K": (size, p)}
        A, B, C, D, K = (np.array(steady[name], float).reshape(shape) for name, shape in shapes.items())
        at = np.array([each["value"] for each in box["operating_point"]])
        fresh_u, fresh_y = recorded(draw, system, 6000, feedback)
        V = error_covariance(A, B, C, D, K, fresh_u - at[:m], fresh_y - at[m:])
        ratio = np.trace(np.linalg.solve(error_covariance(*system[:5], fresh_u, fresh_y), V)) / p - 1
        expected = (n * (m + 2 * p) + p * m) / rows / p
        excess.append((ratio, expected))
        orders.append(size - n)
        times.append(seconds)
        unstable += np.abs(np.linalg.eigvals(A)).max() >= 1
        right += found["status"]["code"] == "ok"
        if size == n:
            gains, steps, spectral = bands(system, box, m)
            in_spectral += spectral
            in_gains += gains
            in_steps += steps
            truth = np.linalg.eigvals(system[0])
            for pole in box["poles"]:
                away = truth - complex(pole["real"], pole["imaginary"])
                away = away[np.argmin(np.abs(away))]
                if pole["real_se"]:
                    covered.append(abs(away.real) < 1.96 * pole["real_se"])
                if pole["imaginary_se"]:
                    covered.append(abs(away.imag) < 1.96 * pole["imaginary_se"])
        print(f"n {n} m {m} p {p} {decibels:4.0f} dB {rows:6} rows {'closed' if feedback.any() else 'open':6} order {size:2} "
              f"{box['refinement']:16} excess {ratio:.4f} expected {expected:.4f} {seconds:.1f} s {found['status']['code']}", flush=True)
    of = np.array(excess)
    print(f"{len(of)} systems for {purpose}: within 1 % of exact maximum likelihood {np.mean(of[:, 0] - of[:, 1] < 0.01):.3f}, median excess over "
          f"expected {np.median(of[:, 0] / of[:, 1]):.2f}, order right {np.mean(np.array(orders) == 0):.2f}, below {np.mean(np.array(orders) < 0):.2f}, "
          f"poles covered {np.mean(covered):.3f} of {len(covered)}, bands of gains {np.mean(in_gains):.3f}, of steps {np.mean(in_steps):.3f}, of gains by spectral analysis {np.mean(in_spectral):.3f}, unstable {unstable}, ok {right}, mean {np.mean(times):.2f} s, longest {np.max(times):.2f} s")


if __name__ == "__main__":
    main(*sys.argv[1:])
