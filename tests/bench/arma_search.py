#!/usr/bin/env python3
"""Random seasonal ARMA models: does the search reach the maximum from a start that says nothing?

usage: arma_search.py BUILD [FIRST [END [STARTS]]]    (models FIRST .. END - 1, 0 .. 49; STARTS of statsmodels each, 8)

Orders to 4, seasons of 4 and 12, roots up to 0.999 of the unit circle, a quarter with factors that nearly cancel, 80 to 5000
samples. This project begins at ar1 = 0.5, everything else 0, with its default starts; statsmodels at its own start and at random
ones within stability and invertibility, and the best of all counts. Where statsmodels claims more than the exact Gaussian
density at its parameters has, that value is left out, and counted. Printed: how many of this project's ends are more than 1e-3
below, exit codes, and the time of both (processor seconds; of statsmodels that of its own start alone).
"""
import collections
import json
import pathlib
import resource
import subprocess
import sys
import tempfile
import time
import warnings

import numpy as np
from scipy.linalg import cholesky, solve_triangular, toeplitz
from scipy.signal import lfilter
from statsmodels.tsa.statespace.sarimax import SARIMAX


def coefficients(partial):
    phi = np.zeros(0)
    for p in partial:
        phi = np.concatenate([phi - p * phi[::-1], [p]])
    return phi


def polynomial(phi, lag=1):
    out = np.zeros(len(phi) * lag + 1)
    out[0] = 1
    out[lag::lag] = -phi
    return out


def with_common_root(ar, ma, random, partial):
    """The same orders, with a pole and a zero side by side."""
    root = random.uniform(-0.9, 0.9)
    beside = root + 0.05 * random.normal()
    return (-np.convolve(polynomial(coefficients(partial(len(ar) - 1))), [1, -root])[1:],
            -np.convolve(polynomial(coefficients(partial(len(ma) - 1))), [1, -beside])[1:])


def random_case(number):
    random = np.random.default_rng(1000 + number)
    season = int(random.choice([0, 0, 4, 12]))
    p, q = (int(random.integers(0, 5)) for _ in range(2))
    P, Q = (int(random.integers(0, 2)) if season else 0 for _ in range(2))
    p = p or int(p + q + P + Q == 0)
    samples = int(np.exp(random.uniform(np.log(80), np.log(5000 if number % 4 == 0 else 600))))

    def partial(count):
        return random.uniform(-1, 1, count) * np.where(random.uniform(size=count) < 0.3, 0.999, 0.8)

    ar, ma, sar, sma = (coefficients(partial(count)) for count in (p, q, P, Q))
    if p and q and random.uniform() < 0.25:
        ar, ma = with_common_root(ar, ma, random, partial)
    A = np.convolve(polynomial(ar), polynomial(sar, season or 1))
    M = np.convolve(polynomial(ma), polynomial(sma, season or 1))
    y = lfilter(M, A, random.normal(size=samples + 2000))[2000:] * np.exp(2 * random.normal())
    return (p, q, P, Q, season), y


def model_file(orders, y):
    """Companion form; products of the factors as formulas."""
    p, q, P, Q, season = orders
    names = {kind: [f"{kind}{k + 1}" for k in range(count)] for kind, count in (("ar", p), ("ma", q), ("sar", P), ("sma", Q))}
    size = max(p + P * season, q + Q * season + 1)

    def entries(short, seasonal, sign):
        out = collections.defaultdict(list)
        for k, a in enumerate([""] + short):
            for j, b in enumerate([""] + seasonal):
                if a or b:
                    out[k + j * season].append(f"{sign}({a})*({b})" if a and b else a + b)
        return {at: " + ".join(terms).replace("+ -", "- ") for at, terms in out.items()}

    rows = [[entries(names["ar"], names["sar"], "-").get(k + 1, "0") for k in range(size)]]
    rows += [["1" if j == k else "0" for j in range(size)] for k in range(size - 1)]
    C = ["1"] + [entries(names["ma"], names["sma"], "").get(k, "0") for k in range(1, size)]
    parameters = "".join(f"  {n}: {{value: {0.5 if n == 'ar1' else 0}}}\n" for kind in names.values() for n in kind)
    matrix = ", ".join("[" + ", ".join(row) + "]" for row in rows)
    return (f"identikal: 1\ntime: {{kind: discrete, step: 1 s}}\nparameters:\n{parameters}  s2: {{value: {np.var(y)!r}, min: 0}}\n"
            f"A: [{matrix}]\nG: [[1]{', [0]' * (size - 1)}]\nC: [[{', '.join(C)}]]\nQ: [[s2]]\nR: [[0]]\ninitial: stationary\n"
            "outputs: [{name: y, column: y}]\n")


def exact_density(y, ar, ma, variance):
    """From the autocovariances, in extended precision, and the Cholesky factor of all samples."""
    size = max(len(ar) - 1, len(ma))
    T = np.zeros((size, size), dtype=np.longdouble)
    T[0, :len(ar) - 1] = -ar[1:]
    T[np.arange(1, size), np.arange(size - 1)] = 1
    C = np.zeros(size, dtype=np.longdouble)
    C[:len(ma)] = ma
    P, F = np.zeros_like(T), T.copy()
    P[0, 0] = 1
    for _ in range(60):
        P, F = P + F @ P @ F.T, F @ F
    seen, covariance = P @ C, np.zeros(len(y))
    for k in range(len(y)):
        covariance[k], seen = C @ seen, T @ seen
    L = cholesky(toeplitz(covariance) * variance, lower=True)
    z = solve_triangular(L, y, lower=True)
    return -0.5 * (len(y) * np.log(2 * np.pi) + z @ z) - np.log(np.diag(L)).sum()


def statsmodels_best(number, orders, y, starts):
    """The best end that the exact density confirms, how many others there were, seconds of the first."""
    p, q, P, Q, season = orders
    model = SARIMAX(y, order=(p, 0, q), seasonal_order=(P, 0, Q, season) if P + Q else (0, 0, 0, 0), trend="n")
    random, best, refuted, first = np.random.default_rng(number), -np.inf, 0, None
    for start in range(starts):
        spread = np.concatenate([1.5 * random.normal(size=len(model.start_params) - 1), [np.std(y)]])
        begin = time.process_time()
        try:
            fit = model.fit(start_params=model.start_params if start == 0 else model.transform_params(spread), disp=0,
                            maxiter=200, cov_type="none")
            first = first or time.process_time() - begin
            if fit.llf <= best + 1e-3:
                continue
            exact = exact_density(y, fit.polynomial_reduced_ar, fit.polynomial_reduced_ma, fit.params[-1])
            refuted += abs(exact - fit.llf) > 1e-3
            best = max(best, min(exact, fit.llf))
        except (ValueError, np.linalg.LinAlgError):
            refuted += 1
    return best, refuted, first or 0.0


def tune(build, model, data):
    before = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime
    done = subprocess.run([build / "identikal", "tune", model, data, "--json", "--quiet"], capture_output=True, text=True)
    seconds = resource.getrusage(resource.RUSAGE_CHILDREN).ru_utime - before
    return json.loads(done.stdout)["objective"]["log_likelihood"], done.returncode, seconds


def main(build, first=0, end=50, starts=8):
    warnings.simplefilter("ignore")
    below, codes, times, refuted, compared = [], collections.Counter(), np.zeros(2), 0, 0
    with tempfile.TemporaryDirectory() as folder:
        model, data = pathlib.Path(folder) / "model.yaml", pathlib.Path(folder) / "data.csv"
        for number in range(first, end):
            orders, y = random_case(number)
            model.write_text(model_file(orders, y))
            np.savetxt(data, y, header="y", comments="", fmt="%.17g")
            reached, code, seconds = tune(build, model, data)
            codes[code] += 1
            p, q, P, Q, season = orders
            if (P and p >= season) or (Q and q >= season):
                continue  # statsmodels takes no lag twice
            best, bad, of_first = statsmodels_best(number, orders, y, starts)
            compared, refuted, times = compared + 1, refuted + bad, times + [seconds, of_first]
            if reached < best - 1e-3:
                below.append((number, orders, len(y), round(best - reached, 4)))
    print(f"{compared} of {end - first} models compared: {len(below)} ends below the best of {starts} starts of statsmodels")
    for each in below:
        print("   model %d, (p, q, P, Q, season) %s, %d samples: %.4f below" % each)
    print(f"exit codes {dict(codes)}; {refuted} ends of statsmodels that the exact density refutes")
    print(f"processor seconds {times[0]:.1f} (search, errors, intervals, tests), statsmodels {times[1]:.1f} (one fit each)")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), *map(int, sys.argv[2:]))
