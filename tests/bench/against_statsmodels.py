#!/usr/bin/env python3
"""The same fits by this project and by statsmodels, on the same CSV files in the same run, and their ratio.

usage: against_statsmodels.py BUILD FOLDER    (FOLDER holds sys1.csv, sys6.csv, sys7.csv: no header, rows = time)

statsmodels gets what its users would write: an MLEModel with a stationary start, variances as squares of the
parameters, its own L-BFGS with its own numerical gradient. Serial: OPENBLAS_NUM_THREADS=1 is set here.
"""
import json
import os
import pathlib
import subprocess
import sys
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"
import numpy as np  # noqa: E402  (after the number of threads)
from statsmodels.tsa.statespace.mlemodel import MLEModel  # noqa: E402

FOUR = [[0.9, 0, 1, 1], [0, -0.8, 0, -1], [0, -0.1, 0.85, 1], [-0.2, 0, 0, -0.9]]
SYSTEMS = {
    "sys1": ([[0.5]], [[1]], [[1]]),
    "sys6": ([[0.8, 1], [0, -0.9]], np.eye(2), np.eye(2)),
    "sys7": (FOUR, [[0, 0, 0.1], [1, 0, 0], [0, 1, 0], [0, 0, 1]], [[1, 0, 0, 1], [0, 1, 1, 0]]),
}


class DiagonalNoise(MLEModel):
    def __init__(self, y, A, G, C):
        A, G, C = (np.asarray(M, float) for M in (A, G, C))
        super().__init__(y, k_states=len(A), k_posdef=G.shape[1])
        self["transition"], self["selection"], self["design"] = A, G, C
        self.q, self.r = G.shape[1], len(C)
        self.initialize_stationary()

    @property
    def start_params(self):
        return np.ones(self.q + self.r)

    @property
    def param_names(self):
        return [f"q{i}" for i in range(self.q)] + [f"r{i}" for i in range(self.r)]

    def transform_params(self, free):
        return free**2

    def untransform_params(self, variances):
        return np.sqrt(variances)

    def update(self, params, **kwargs):
        params = super().update(params, **kwargs)
        self["state_cov"] = np.diag(params[: self.q])
        self["obs_cov"] = np.diag(params[self.q:])


def best(run, repeats):
    times = []
    for _ in range(repeats):
        begin = time.perf_counter()
        run()
        times.append(time.perf_counter() - begin)
    return min(times)


def main(build, folder):
    bench = subprocess.run([pathlib.Path(build) / "tests/likelihood_bench", f"--files={folder}", "--benchmark_format=json",
                            "--benchmark_filter=^file/"], capture_output=True, text=True, check=True).stdout
    ours = {b["name"]: b["real_time"] * 1e-3 for b in json.loads(bench)["benchmarks"]}  # us -> ms
    print(f"{'':8}{'fit [ms]':>10}{'statsmodels':>14}{'ratio':>8}   {'value [us]':>10}{'statsmodels':>14}{'ratio':>8}")
    for name, (A, G, C) in SYSTEMS.items():
        y = np.loadtxt(pathlib.Path(folder) / f"{name}.csv", delimiter=",", ndmin=2)
        model = DiagonalNoise(y, A, G, C)
        fit = best(lambda: model.fit(disp=0, cov_type="none"), 5) * 1e3
        start = model.start_params
        value = best(lambda: model.loglike(start), 20) * 1e3
        our_fit, our_value = ours[f"file/fit/{name}"], ours[f"file/value/{name}"]
        print(f"{name:8}{our_fit:10.3f}{fit:14.1f}{fit / our_fit:8.0f}   {our_value * 1e3:10.2f}{value * 1e3:14.1f}{value / our_value:8.0f}")


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
