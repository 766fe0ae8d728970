#!/usr/bin/env python3
"""The same fits by this project and by statsmodels on the same recordings, interleaved: processor seconds, medians.

usage: against_statsmodels.py BUILD FOLDER [--rounds 3] [--rows air,co2] [--ours-only]

FOLDER holds the recordings named in ROWS below as CSV files (those that are missing are left out). Ours is the
whole command `tune`, with its default starts and with 1: reading, search, errors, profile intervals and tests. statsmodels
is one bare fit from the same start, without errors, of what its users would write: an MLEModel, variances as
squares of the parameters, its own L-BFGS with its own numerical gradient, its exact diffuse start. Reading the file
and building the model is not counted for it. Serial: OPENBLAS_NUM_THREADS=1 is set here.
"""
import argparse
import json
import os
import pathlib
import resource
import statistics
import subprocess
import sys
import tempfile
import time

os.environ["OPENBLAS_NUM_THREADS"] = "1"
import numpy as np  # noqa: E402  (after the number of threads)
from scipy.linalg import block_diag, expm  # noqa: E402


def structural(season):
    """Local linear trend and dummy season: A, G, C."""
    n = 2 + season - 1
    A = np.zeros((n, n))
    A[0, 0] = A[0, 1] = A[1, 1] = 1
    A[2, 2:] = -1
    A[range(3, n), range(2, n - 1)] = 1
    G = np.zeros((n, 3))
    G[:3] = np.eye(3)
    C = np.zeros((1, n))
    C[0, 0] = C[0, 2] = 1
    return A, G, C


SIXTH = block_diag(*([[0.9 * np.cos(w), 0.9 * np.sin(w)], [-0.9 * np.sin(w), 0.9 * np.cos(w)]] for w in (0.3, 0.8, 1.4)))
FOUR = [[0.9, 0, 1, 1], [0, -0.8, 0, -1], [0, -0.1, 0.85, 1], [-0.2, 0, 0, -0.9]]
FOUR_G = [[0, 0, 0.1], [1, 0, 0], [0, 1, 0], [0, 0, 1]]


def row(file, columns, A, G, C, q, r, names, rows=None, initial="diffuse", mean=None, sd=None, phi=None, dt=None):
    """q, r: which parameter drives each noise; names: parameter -> start; phi: (row, name) of a free entry of A;
    dt: the continuous model's period, q a density."""
    return dict(file=file, columns=columns, A=np.array(A, float), G=np.array(G, float), C=np.array(C, float), q=q, r=r,
                names=names, rows=rows, initial=initial, mean=mean, sd=sd, phi=phi, dt=dt)


def trend_and_season(file, season, ql, qs, qw, r):
    return row(file, ["y"], *structural(season), ["ql", "qs", "qw"], ["r"], dict(ql=ql, qs=qs, qw=qw, r=r))


MOVING = [[0, 1, 0, 0], [0, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]]
CLOCK = dict(qf=0.01, qr=1e-8, r=0.01)
ROWS = {
    "air": trend_and_season("air.csv", 12, 1e-3, 1e-5, 1e-4, 1e-3),
    "co2": trend_and_season("co2.csv", 12, 0.1, 1e-3, 0.01, 0.1),
    "nottem": trend_and_season("nottem.csv", 12, 1.0, 0.01, 0.1, 1.0),
    "ukgas": trend_and_season("ukgas.csv", 4, 1e-3, 1e-5, 1e-4, 1e-3),
    "ocxo": row("ocxo12.csv", ["y"], [[1]], [[1]], [[1]], ["q"], ["r"], dict(q=1.0, r=1000.0)),
    "gyro": row("gyro.csv", ["gx", "gy", "gz"], np.eye(3), np.eye(3), np.eye(3), ["q1", "q2", "q3"], ["r1", "r2", "r3"],
                dict(q1=1e-6, q2=1e-6, q3=1e-6, r1=0.01, r2=0.01, r3=0.01)),
    "car": row("car50.csv", ["px", "py", "vx", "vy"], MOVING, [[0, 0], [1, 0], [0, 0], [0, 1]],
               [[1, 0, 0, 0], [0, 0, 1, 0], [0, 1, 0, 0], [0, 0, 0, 1]], ["q", "q"], ["rp", "rp", "rv", "rv"],
               dict(q=1.0, rp=1.0, rv=0.1), dt=0.02),
    "gps1pps": row("gps30k.csv", ["y"], [[1, 0], [0, 0.9]], np.eye(2), [[1, 1]], ["ql", "q"], ["r"],
                   dict(phi=0.9, q=1.0, ql=0.01, r=1.0), initial="given", mean=[276, 0], sd=[30, 30], phi=(1, "phi")),
    "clock1000": row("cs_clock.csv", ["y"], [[1, 1], [0, 1]], np.eye(2), [[1, 0]], ["qf", "qr"], ["r"], CLOCK, rows=1000),
    "clock10k": row("cs_clock.csv", ["y"], [[1, 1], [0, 1]], np.eye(2), [[1, 0]], ["qf", "qr"], ["r"], CLOCK, rows=10000),
    "clock30k": row("cs_clock.csv", ["y"], [[1, 1], [0, 1]], np.eye(2), [[1, 0]], ["qf", "qr"], ["r"], CLOCK, rows=30000),
    "clock": row("cs_clock.csv", ["y"], [[1, 1], [0, 1]], np.eye(2), [[1, 0]], ["qf", "qr"], ["r"], CLOCK),
    "sys7": row("sys7.csv", None, FOUR, FOUR_G, [[1, 0, 0, 1], [0, 1, 1, 0]], ["q1", "q2", "q3"], ["r1", "r2"],
                dict(q1=1.0, q2=1.0, q3=1.0, r1=1.0, r2=1.0), initial="stationary"),
    "n6r3": row(None, ["a", "b", "c"], SIXTH, np.eye(6), np.kron(np.eye(3), [[1, 0.5]]), ["q1", "q1", "q2", "q2", "q3", "q3"],
                ["r1", "r2", "r3"], dict(q1=1.0, q2=1.0, q3=1.0, r1=1.0, r2=1.0, r3=1.0), rows=10000, initial="stationary"),
}
TOO_LONG = {"clock"}  # for statsmodels: minutes


def simulated(spec):
    rng = np.random.default_rng(1)
    x, y = np.zeros(len(spec["A"])), []
    for w, v in zip(rng.normal(size=(spec["rows"], spec["G"].shape[1])), rng.normal(size=(spec["rows"], len(spec["C"])))):
        y.append(spec["C"] @ x + v)
        x = spec["A"] @ x + spec["G"] @ w
    return np.array(y)


def outputs(spec, folder):
    if spec["file"] is None:
        return simulated(spec)
    path = folder / spec["file"]
    with path.open() as file:
        head = file.readline().strip().split(",")
    titled = spec["columns"] is not None
    table = np.genfromtxt(path, delimiter=",", skip_header=1 if titled else 0, max_rows=spec["rows"], ndmin=2)
    return table[:, [head.index(c) for c in spec["columns"]]] if titled else table


def model_text(name, spec):
    def matrix(entries):
        return json.dumps([[e if isinstance(e, str) else float(e) for e in line] for line in entries])

    A = spec["A"].tolist()
    if spec["phi"]:
        at, phi = spec["phi"]
        A[at][at] = phi
    lines = ["identikal: 1", f"name: {name}", "parameters:"]
    for key, start in spec["names"].items():
        lines.append(f"  {key}: {{value: {start}, min: 0{', max: 0.9999' if spec['phi'] and key == spec['phi'][1] else ''}}}")
    step = f"{{kind: continuous, step: {spec['dt']} s}}" if spec["dt"] else "{step: 1 s}"
    for key in ("q", "r"):
        diagonal = [[name if i == j else 0 for j in range(len(spec[key]))] for i, name in enumerate(spec[key])]
        lines.append(f"{key.upper()}: {matrix(diagonal)}")
    lines += [f"time: {step}", f"A: {matrix(A)}", f"C: {matrix(spec['C'])}", f"G: {matrix(spec['G'])}"]
    if spec["dt"]:
        lines.append("noise: {process: density}")
    lines.append("initial: " + (f"{{mean: {spec['mean']}, sd: {spec['sd']}}}" if spec["initial"] == "given" else spec["initial"]))
    lines.append("outputs: [" + ", ".join(f"{{name: y{i}, column: y{i}}}" for i in range(len(spec["C"]))) + "]")
    return "\n".join(lines) + "\n"


def statsmodels_fit(spec, y):
    """A function that fits once."""
    from statsmodels.tsa.statespace.mlemodel import MLEModel
    A, G, C, names = spec["A"], spec["G"], spec["C"], list(spec["names"])

    class DiagonalNoise(MLEModel):
        def __init__(self):
            super().__init__(y, k_states=len(A), k_posdef=len(A) if spec["dt"] else G.shape[1])
            self["design"] = C
            if spec["dt"]:
                n, dt = len(A), spec["dt"]
                self["selection"] = np.eye(n)
                self["transition"] = expm(A * dt)
                self.per_density = []  # van Loan 1978
                for i in range(G.shape[1]):
                    g = G[:, [i]]
                    big = expm(np.block([[-A, g @ g.T], [np.zeros((n, n)), A.T]]) * dt)
                    self.per_density.append(big[n:, n:].T @ big[:n, n:])
            else:
                self["transition"], self["selection"] = A, G
            if spec["initial"] == "diffuse":
                self.ssm.initialize_diffuse()
            elif spec["initial"] == "given":
                self.ssm.initialize_known(np.array(spec["mean"], float), np.diag(np.square(spec["sd"])).astype(float))
            else:
                self.initialize_stationary()

        start_params = property(lambda self: np.array(list(spec["names"].values())))
        param_names = property(lambda self: names)

        def transform_params(self, free):
            return np.array([v if self.is_phi(n) else v * v for n, v in zip(names, free)])

        def untransform_params(self, values):
            return np.array([v if self.is_phi(n) else np.sqrt(v) for n, v in zip(names, values)])

        def is_phi(self, name):
            return spec["phi"] is not None and name == spec["phi"][1]

        def update(self, params, **kwargs):
            at = dict(zip(names, super().update(params, **kwargs)))
            if spec["phi"]:
                i, phi = spec["phi"]
                self["transition", i, i] = at[phi]
            if spec["dt"]:
                self["state_cov"] = sum(at[q] * unit for q, unit in zip(spec["q"], self.per_density))
            else:
                self["state_cov"] = np.diag([at[q] for q in spec["q"]])
            self["obs_cov"] = np.diag([at[r] for r in spec["r"]])

    model = DiagonalNoise()
    return lambda: model.fit(disp=0, cov_type="none", maxiter=500).llf


def timed(run):
    begin = time.process_time()
    value = run()
    return time.process_time() - begin, value


# Models of formulas, which statsmodels has not: file of the model and of the recording, both in FOLDER.
OURS_ALONE = {"ctrv": ("car_ctrv_ekf.yaml", "carraw1k.csv")}


def ours(build, model, data, starts):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    run = subprocess.run([build / "identikal", "tune", model, data, "--method", "ml", *starts, "--json", "--quiet"],
                         capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    try:
        objective = json.loads(run.stdout)["objective"]
    except (ValueError, KeyError):
        sys.exit(f"{model}: exit {run.returncode}\n{run.stdout[-500:]}{run.stderr[-500:]}")
    return seconds, objective, run.returncode


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("build", type=pathlib.Path)
    parser.add_argument("folder", type=pathlib.Path)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--rows", default=",".join([*ROWS, *OURS_ALONE]))
    parser.add_argument("--ours-only", action="store_true")
    args = parser.parse_args()
    print(f"{'processor seconds':18}{'default':>9}{'1 start':>9}{'statsm.':>9}{'ratio':>9}{'1':>7}{'eval.':>7}{'exit':>6}"
          f"{'logL':>16}{'statsm.':>16}  path")
    with tempfile.TemporaryDirectory() as scratch:
        for name in args.rows.split(","):
            if name in OURS_ALONE:
                model, data = (args.folder / file for file in OURS_ALONE[name])
                if not data.exists():
                    continue
                runs = [[ours(args.build, model, data, starts) for _ in range(args.rounds)] for starts in ([], ["--starts", "1"])]
                default, one = (statistics.median(run[0] for run in each) for each in runs)
                print(f"{name:18}{default:9.3f}{one:9.3f}{'':25}{runs[0][0][1]['evaluations']:7}{runs[0][0][2]:6}"
                      f"{runs[0][0][1]['log_likelihood']:16.6f}", flush=True)
                continue
            spec = ROWS[name]
            if spec["file"] and not (args.folder / spec["file"]).exists():
                continue
            y = outputs(spec, args.folder)
            data, model = pathlib.Path(scratch) / f"{name}.csv", pathlib.Path(scratch) / f"{name}.yaml"
            model.write_text(model_text(name, spec))
            with data.open("w") as file:
                file.write(",".join(f"y{i}" for i in range(y.shape[1])) + "\n")
                file.writelines(",".join("" if np.isnan(v) else repr(float(v)) for v in line) + "\n" for line in y)
            theirs = None if args.ours_only or name in TOO_LONG else statsmodels_fit(spec, y)
            default, one, other, value = [], [], [], float("nan")
            for _ in range(args.rounds):
                default.append(ours(args.build, model, data, [])[0])
                seconds, objective, code = ours(args.build, model, data, ["--starts", "1"])
                one.append(seconds)
                if theirs:
                    seconds, value = timed(theirs)
                    other.append(seconds)
            default, one = statistics.median(default), statistics.median(one)
            other = statistics.median(other) if other else float("nan")
            print(f"{name:18}{default:9.3f}{one:9.3f}{other:9.3f}{other / default:9.1f}{other / one:7.1f}{objective['evaluations']:7}{code:6}"
                  f"{objective['log_likelihood']:16.6f}{value:16.6f}  {objective['evaluation_method']}", flush=True)


if __name__ == "__main__":
    main()
