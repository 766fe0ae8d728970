#!/usr/bin/env python3
"""Random seasonal ARMA models: are the standard errors those of the observed information?

usage: arma_errors.py BUILD [FIRST [END]]    (models FIRST .. END - 1 of arma_search.py, 0 .. 49; those of at most 600 samples)

The information is taken from second differences of statsmodels' exact log-likelihood at this project's estimates, by two pairs of
steps; where they do not agree with each other to a tenth of what is asked, 1e-4, the differences say nothing. Estimates with a root
on the unit circle, or without an error, are left out. Printed: how many models are off, and the largest difference of the others.
"""
import json
import pathlib
import subprocess
import sys
import tempfile
import warnings

import numpy as np
from statsmodels.tsa.statespace.sarimax import SARIMAX

from arma_search import model_file, random_case


def by_differences(value, x, se, step):
    """Standard errors from Richardson's extrapolation of second differences."""

    def hessian(h):
        out = np.zeros((len(x), len(x)))
        move = np.diag(h * se)
        for i in range(len(x)):
            for j in range(i + 1):
                a, b = move[i], move[j]
                four = value(x + a + b) - value(x + a - b) - value(x - a + b) + value(x - a - b)
                out[i, j] = out[j, i] = four / (4 * a[i] * b[j])
        return out

    return np.sqrt(np.diag(np.linalg.inv(-(4 * hessian(step) - hessian(2 * step)) / 3)))


def compared(result, orders, y):
    """The largest relative difference of the errors, and that of the differences by themselves; nothing where there are none."""
    p, q, P, Q, season = orders
    found = {each["name"]: each for each in result["parameters"]}
    names = [f"{kind}{k + 1}" for kind, count in (("ar", p), ("ma", q), ("sar", P), ("sma", Q)) for k in range(count)] + ["s2"]
    if any(each["code"] == "at_bound" for each in result["warnings"]) or any(found[name]["se"] is None for name in names):
        return None
    model = SARIMAX(y, order=(p, 0, q), seasonal_order=(P, 0, Q, season) if P + Q else (0, 0, 0, 0), trend="n")
    model.ssm.tolerance = 0
    x, se = (np.array([found[name][key] for name in names]) for key in ("value", "se"))
    try:
        fine, coarse = (by_differences(model.loglike, x, se, step) for step in (0.02, 0.03))
    except np.linalg.LinAlgError:
        return None
    return np.max(np.abs(se / fine - 1)), np.max(np.abs(fine / coarse - 1))


def main(build, first=0, end=50):
    warnings.simplefilter("ignore")
    all_of_them = []
    with tempfile.TemporaryDirectory() as folder:
        model, data = pathlib.Path(folder) / "model.yaml", pathlib.Path(folder) / "data.csv"
        for number in range(first, end):
            orders, y = random_case(number)
            p, q, P, Q, season = orders
            if len(y) > 600 or (P and p >= season) or (Q and q >= season):
                continue
            model.write_text(model_file(orders, y))
            np.savetxt(data, y, header="y", comments="", fmt="%.17g")
            done = subprocess.run([build / "identikal", "tune", model, data, "--json", "--quiet"], capture_output=True, text=True)
            off = compared(json.loads(done.stdout), orders, y)
            if off is not None:
                all_of_them.append((*off, number))
    told = [each for each in all_of_them if each[1] < 1e-5]
    print(f"{len(all_of_them)} models with errors; the differences tell them to 1e-5 in {len(told)}: off by more than 1e-4 are "
          f"{sum(each[0] > 1e-4 for each in told)}, by {max(told)[0]:.1e} at most (model {max(told)[2]})")


if __name__ == "__main__":
    main(pathlib.Path(sys.argv[1]), *map(int, sys.argv[2:]))
