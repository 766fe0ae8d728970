#!/usr/bin/env python3
"""Does tune arrive at the maximum of ordinary recordings, and say so? Beside the best of 20 starts of statsmodels.

usage: search_on_recordings.py IDENTIKAL MODELS [--witness FILE] [--only NAME]...

MODELS is a folder of models and recordings, NAME.yaml beside its CSV file (the table below says which); the other recordings
are those that come with python3-statsmodels, which this needs. Asked of every row: exit status 0 or 1, never 3; a log-likelihood
that is not below the best of the 20 by more than 1e-4; several_maxima as a warning only where the 20 find two. Prints a line per
recording and a count, and ends with status 1 where one of them falls short. The 20 starts take some ten minutes; --witness keeps
what they found in FILE, and reads it where it exists.

The witness: exact diffuse or given start, statsmodels' Kalman filter, L-BFGS-B on logarithms of variances, numeric gradients,
starts scattered over four decades about the file's (other numbers: within their bounds, or 60 % about the file's); its two maxima
are ends with a projected gradient of less than 0.01 nats, at least 0.05 nats apart in log-likelihood, that restarts do not leave.
"""
import json
import math
import pathlib
import resource
import subprocess
import sys
import tempfile

import numpy as np
import statsmodels.api as sm
import yaml
from scipy.optimize import minimize
from statsmodels.tsa.statespace.initialization import Initialization
from statsmodels.tsa.statespace.kalman_filter import KalmanFilter

# model, recording, rows (0: all)
FILES = [("bsm_air", "air", 0), ("bsm_co2", "co2", 0), ("bsm_nottem", "nottem", 0), ("bsm_ukgas", "ukgas", 0),
         ("ocxo_scaled", "ocxo12", 0), ("gyro_static", "gyro", 0), ("multirate_50Hz", "car50", 0), ("gps1pps", "gps30k", 0),
         ("cs_clock", "cs_clock", 1000), ("cs_clock", "cs_clock", 3000), ("cs_clock", "cs_clock", 10000),
         ("lung_bivariate_fullR", "lung", 0), ("lung_full", "lung", 0), ("presidents_ar3", "presidents", 0)]

LEVEL = {"p": {"q": {"value": "%q", "min": 0}, "r": {"value": "%r", "min": 0}},
         "A": [[1]], "C": [[1]], "Q": [["q"]], "R": [["r"]], "initial": "diffuse"}
TREND = {"p": {"ql": {"value": "%q", "min": 0}, "qs": {"value": "%s", "min": 0}, "r": {"value": "%r", "min": 0}},
         "A": [[1, 1], [0, 1]], "C": [[1, 0]], "Q": [["ql", 0], [0, "qs"]], "R": [["r"]], "initial": "diffuse"}
AR1 = {"p": {"phi": {"value": 0.5, "min": -0.9999, "max": 0.9999}, "q": {"value": "%q", "min": 0},
             "r": {"value": "%r", "min": 0}},
       "A": [["phi"]], "C": [[1]], "Q": [["q"]], "R": [["r"]], "initial": "stationary"}
# What the witness reads instead of a model in continuous time and one of formulas.
step = 0.02
WITNESS = {
    "multirate_50Hz": {
        "A": [[1, step, 0, 0], [0, 1, 0, 0], [0, 0, 1, step], [0, 0, 0, 1]], "G": np.eye(4).tolist(),
        "Q": [["q*%r" % (step**3 / 3), "q*%r" % (step**2 / 2), 0, 0], ["q*%r" % (step**2 / 2), "q*%r" % step, 0, 0],
              [0, 0, "q*%r" % (step**3 / 3), "q*%r" % (step**2 / 2)], [0, 0, "q*%r" % (step**2 / 2), "q*%r" % step]]},
    "presidents_ar3": {
        "A": [["a1", "a2", "a3"], [1, 0, 0], [0, 1, 0]], "C": [[1, 0, 0]], "G": [[1], [0], [0]], "Q": [["q"]], "R": [[0]],
        "d": "mu", "initial": "stationary"}}
macro = sm.datasets.macrodata.load_pandas().data


def log100(values):
    return 100 * np.log(np.asarray(values, float))


SERIES = {
    "nile_level": (LEVEL, sm.datasets.nile.load_pandas().data["volume"]),
    "nile_trend": (TREND, sm.datasets.nile.load_pandas().data["volume"]),
    "sunspots_level": (LEVEL, sm.datasets.sunspots.load_pandas().data["SUNACTIVITY"]),
    "sunspots_ar1": (AR1, sm.datasets.sunspots.load_pandas().data["SUNACTIVITY"]),
    "elnino_level": (LEVEL, sm.datasets.elnino.load_pandas().data.iloc[:, 1:].values.ravel()),
    "elnino_ar1": (AR1, sm.datasets.elnino.load_pandas().data.iloc[:, 1:].values.ravel()),
    "inflation_level": (LEVEL, macro["infl"]),
    "inflation_ar1": (AR1, macro["infl"]),
    "gdp_trend": (TREND, log100(macro["realgdp"])),
    "investment_trend": (TREND, log100(macro["realinv"])),
    "cpi_trend": (TREND, log100(macro["cpi"])),
    "bill_rate_level": (LEVEL, macro["tbilrate"]),
    "unemployment_ar1": (AR1, macro["unemp"]),
    "money_trend": (TREND, log100(macro["m1"])),
    "real_interest_level": (LEVEL, macro["realint"]),
    "copper_trend": (TREND, sm.datasets.copper.load_pandas().data["WORLDCONSUMPTION"] / 1000),
    "co2_weekly_level": (LEVEL, sm.datasets.co2.load_pandas().data["co2"]),
}


def series_case(form, values):
    values = np.asarray(values, float)
    if form is AR1:
        values = values - np.nanmean(values)
    scale = np.nanvar(np.diff(values))
    text = json.dumps(form["p"])
    for mark, value in (("%q", 0.3 * scale), ("%s", 0.01 * scale), ("%r", 0.3 * scale)):
        text = text.replace('"%s"' % mark, "%.6g" % value)
    model = {"identikal": 1, "name": "series", "time": {"step": "1 s"}, "parameters": json.loads(text)}
    model.update({k: form[k] for k in ("A", "C", "Q", "R", "initial")})
    model["outputs"] = [{"name": "y", "column": "y"}]
    return model, values.reshape(-1, 1)


def read_csv(path, columns, rows):
    lines = [l for l in path.read_text().splitlines() if l and not l.startswith("#")]
    head = lines[0].split(",")
    body = lines[1:1 + rows] if rows else lines[1:]
    at = [head.index(c) for c in columns]
    out = np.full((len(body), len(at)), np.nan)
    for i, line in enumerate(body):
        cells = line.split(",")
        for j, k in enumerate(at):
            if k < len(cells) and cells[k].strip() not in ("", "NaN", "nan"):
                out[i, j] = float(cells[k])
    return out, [lines[0]] + body


# --- the witness ---------------------------------------------------------------------------------------------------------

class Witness:
    def __init__(self, model, y):
        self.model, self.y = model, y
        self.names, self.kind, self.start, self.box = [], [], [], []
        for name, p in (model.get("parameters") or {}).items():
            p = p if isinstance(p, dict) else {"value": p}
            low, high = float(p.get("min", -math.inf)), float(p.get("max", math.inf))
            self.add(name, float(p["value"]), low, high)
        n = len(model["A"])
        width = len(model["G"][0]) if "G" in model else n
        self.size = {"Q": width, "R": len(model["C"])}
        for block in "QR":
            form = model[block]
            if not isinstance(form, dict):
                continue
            for j in range(self.size[block]):
                for i in range(j, self.size[block]):
                    self.add("L%s%d%d" % (block, i, j), math.sqrt(float(form["start"])) if i == j else 0.0, -math.inf, math.inf)
        self.pairs = self.covariances()
        self.kf = KalmanFilter(k_endog=y.shape[1], k_states=n, k_posdef=width)
        self.kf.bind(np.ascontiguousarray(y))
        self.kf.memory_no_forecast = self.kf.memory_no_filtered = self.kf.memory_no_gain = True

    def add(self, name, value, low, high):
        self.names.append(name)
        self.kind.append("log" if low == 0.0 and high == math.inf else "box" if math.isfinite(low + high) else "free")
        self.start.append(value)
        self.box.append((low, high))

    # Covariances by name become correlations.
    def covariances(self):
        out = {}
        for block in "QR":
            M = self.model[block]
            if isinstance(M, dict):
                continue
            for i in range(len(M)):
                for j in range(i):
                    if isinstance(M[i][j], str) and M[i][j] in self.names:
                        out[M[i][j]] = (M[i][i], M[j][j])
        return out

    def values(self, z):
        out = {}
        for name, kind, box, v in zip(self.names, self.kind, self.box, z):
            if name in self.pairs:
                out[name] = math.tanh(v)
            elif kind == "log":
                out[name] = math.exp(v)
            elif kind == "box":
                out[name] = box[0] + (box[1] - box[0]) / (1 + math.exp(-v))
            else:
                out[name] = v
        for name, (a, b) in self.pairs.items():
            out[name] *= math.sqrt(out[a] * out[b])
        return out

    def coordinates(self, start):
        z = []
        for name, kind, box, v in zip(self.names, self.kind, self.box, start):
            if name in self.pairs:
                z.append(v)
            elif kind == "log":
                z.append(math.log(max(v, 1e-12)))
            elif kind == "box":
                s = min(max((v - box[0]) / (box[1] - box[0]), 1e-9), 1 - 1e-9)
                z.append(math.log(s / (1 - s)))
            else:
                z.append(v)
        return np.array(z)

    def matrix(self, name, at):
        form = self.model[name]
        if isinstance(form, dict):
            n = self.size[name]
            L = np.zeros((n, n))
            for j in range(n):
                for i in range(j, n):
                    L[i, j] = at["L%s%d%d" % (name, i, j)]
            return L @ L.T
        return np.array([[eval(str(e), {}, at) if isinstance(e, str) else float(e) for e in row] for row in form])

    def minus(self, z):
        if np.abs(z).max() > 300:
            return 1e10
        at = self.values(z)
        k = self.kf
        n = k.k_states
        k["transition"], k["design"] = self.matrix("A", at), self.matrix("C", at)
        k["selection"] = np.array(self.model["G"], float) if "G" in self.model else np.eye(n)
        k["state_cov"], k["obs_cov"] = self.matrix("Q", at), self.matrix("R", at)
        if "d" in self.model:
            k["obs_intercept"] = np.array([at[self.model["d"]]])
        initial = self.model["initial"]
        try:
            if initial == "diffuse":
                k.initialize(Initialization(n, "diffuse"))
            elif initial == "stationary":
                if np.abs(np.linalg.eigvals(k["transition"])).max() >= 1:
                    return 1e10
                k.initialize(Initialization(n, "stationary"))
            else:
                mean = np.array([float(eval(str(v), {}, at)) for v in initial["mean"]])
                k.initialize_known(mean, np.diag(np.array(initial["sd"], float) ** 2))
            value = -k.loglike()
            if initial == "diffuse":  # here the samples that the start takes count without their 2 pi
                value -= 0.5 * n * math.log(2 * math.pi)
        except (ValueError, np.linalg.LinAlgError):
            return 1e10
        return value if math.isfinite(value) else 1e10

    def search(self, z):
        best = minimize(self.minus, z, method="L-BFGS-B", options={"maxiter": 300, "ftol": 1e-13, "gtol": 1e-5})
        for _ in range(2):  # L-BFGS stops on rounding of numeric gradients
            again = minimize(self.minus, best.x, method="L-BFGS-B", options={"maxiter": 300, "ftol": 1e-13, "gtol": 1e-5})
            gain = best.fun - again.fun
            best = again
            if gain < 1e-6:
                break
        return best

    def run(self, starts=20):
        random = np.random.default_rng(1)
        ends = []
        for s in range(starts):
            start = list(self.start)
            for i, kind in enumerate(self.kind):
                if s == 0:
                    break
                if self.names[i] in self.pairs:
                    start[i] = random.uniform(-1, 1)
                elif kind == "log":
                    start[i] *= 10 ** random.uniform(-2, 2)
                elif kind == "box":
                    start[i] = random.uniform(*self.box[i])
                else:
                    start[i] = start[i] * (1 + 0.6 * random.uniform(-0.5, 0.5)) + (
                        0.3 * random.normal() if self.names[i][0] == "L" else 0)
            ends.append(self.search(self.coordinates(start)))
        ends.sort(key=lambda e: e.fun)
        best = ends[0]
        polish = minimize(self.minus, best.x, method="Nelder-Mead", options={"maxiter": 100 * len(best.x), "xatol": 1e-7, "fatol": 1e-9})
        best = polish if polish.fun < best.fun else best
        others = []
        for end in ends[1:]:
            if end.fun < best.fun + 0.05 or np.abs(end.jac).max() > 0.01:
                continue
            moved = [self.search(end.x + 0.5 * random.normal(size=len(end.x))).fun for _ in range(3)]
            if min(moved) > end.fun - 0.02 and not any(abs(o + end.fun) < 0.02 for o in others):
                others.append(-end.fun)
        return {"L": -best.fun, "at": self.values(best.x), "others": others, "calls": None}


# --- ours ----------------------------------------------------------------------------------------------------------------

def tune(binary, model, csv_lines, options=()):
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        (folder / "m.yaml").write_text(model if isinstance(model, str) else yaml.safe_dump(model, default_flow_style=None))
        (folder / "d.csv").write_text("\n".join(csv_lines) + "\n")
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        done = subprocess.run([binary, "tune", str(folder / "m.yaml"), str(folder / "d.csv"), "--json", "--quiet", *options],
                              capture_output=True, text=True)
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    result = json.loads(done.stdout) if done.stdout.startswith("{") else {}
    if not result:
        print(done.stderr)
    return done.returncode, result, seconds


def cases(folder):
    for name, data, rows in FILES:
        text = (folder / (name + ".yaml")).read_text()
        model = yaml.safe_load(text)
        y, lines = read_csv(folder / (data + ".csv"), [o["column"] if isinstance(o, dict) else o for o in model["outputs"]], rows)
        yield name + (":%d" % rows if rows else ""), text, {**model, **WITNESS.get(name, {})}, y, lines
    for name, (form, values) in SERIES.items():
        model, y = series_case(form, values)
        lines = ["t,y"] + ["%d,%s" % (t, "" if math.isnan(v) else repr(float(v))) for t, v in enumerate(y[:, 0])]
        yield name, model, model, y, lines


def main():
    arguments = sys.argv[1:]
    only = [arguments[i + 1] for i, a in enumerate(arguments) if a == "--only"]
    kept = next((pathlib.Path(arguments[i + 1]) for i, a in enumerate(arguments) if a == "--witness"), None)
    binary, folder = arguments[0], pathlib.Path(arguments[1])
    found = json.loads(kept.read_text()) if kept and kept.exists() else {}
    short = 0
    print("%-24s %5s %16s %10s %8s %8s  %s" % ("recording", "exit", "log-likelihood", "- witness", "maxima", "seconds", "status"))
    for name, ours, model, y, lines in cases(folder):
        if only and name not in only:
            continue
        if name not in found:
            found[name] = Witness(model, y).run()
            if kept:
                kept.write_text(json.dumps(found, indent=1))
        witness = found[name]
        if binary == "-":
            print(name, witness, flush=True)
            continue
        code, result, seconds = tune(binary, ours, lines)
        L = (result.get("objective") or {}).get("log_likelihood") or math.nan
        several = any(w.get("code") == "several_maxima" and w.get("severity") == "warning" for w in result.get("warnings", []))
        good = code in (0, 1) and L > witness["L"] - 1e-4 and (not several or witness["others"])
        short += not good
        print("%-24s %5d %16.6f %10.6f %4s/%-3d %8.3f  %s%s" %
              (name, code, L, L - witness["L"], "2+" if several else "1", 1 + len(witness["others"]), seconds,
               (result.get("status") or {}).get("code"), "" if good else "   <-- SHORT"), flush=True)
    print("%d fall short" % short)
    return 1 if short else 0


if __name__ == "__main__":
    sys.exit(main())
