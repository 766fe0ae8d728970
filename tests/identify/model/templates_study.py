#!/usr/bin/env python3
"""Bias and coverage of the extended Kalman filter's estimates on the templates pendulum and battery.

templates_study.py IDENTIKAL [RUNS]

Asked: |bias| <= sd/3 and 95 % intervals that cover the truth in 90 to 98 % of 100 recordings. By chance alone a bias
of 1/3 sd has a share of 0.1 % per parameter, coverage of 95 % ends outside of 90..98 in 4 %. Every search begins with
the physical values to be estimated 20 % off.
"""
import json
import math
import pathlib
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from templates_test import commands, truth

identikal = str(pathlib.Path(sys.argv[1]).resolve())
RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 100


def run(name, seed):
    text = subprocess.run([identikal, "init", name], capture_output=True, text=True, check=True).stdout
    with tempfile.TemporaryDirectory() as folder:
        steps = [step.replace("identikal", shlex.quote(identikal), 1) for step in commands(text)]
        quiet = {"shell": True, "cwd": folder, "capture_output": True, "text": True}
        subprocess.run(steps[0], check=True, **quiet)
        subprocess.run(f"{steps[1]} --seed {seed}", check=True, **quiet)
        known = truth(pathlib.Path(folder) / "demo" / "simulated.csv")
        unknown = {"pendulum": ["l", "d"], "battery": ["Q", "R0", "R1", "C1"]}[name]
        off = " ".join(f"--set {p}={1.2 * known[p]}" for p in unknown)
        fit = subprocess.run(f"{steps[2]} --json --starts 1 {off}", **quiet)
    result = json.loads(fit.stdout)
    return {p["name"]: (p["value"], p["se"], p.get("profile95") or p["ci95"], known[p["name"]], fit.returncode)
            for p in result["parameters"] if not p["fixed"]}


failed = False
for name in ["pendulum", "battery"]:
    with ThreadPoolExecutor() as pool:
        runs = list(pool.map(lambda seed: run(name, seed), range(1, RUNS + 1)))
    print(f"{name}: {RUNS} recordings, {sum(list(r.values())[0][4] == 0 for r in runs)} with status ok")
    for parameter in runs[0]:
        values = [r[parameter] for r in runs]
        mean = sum(v[0] for v in values) / RUNS
        sd = math.sqrt(sum((v[0] - mean) ** 2 for v in values) / (RUNS - 1))
        bias = (mean - values[0][3]) / sd
        covered = sum(v[2][0] is not None and v[2][0] <= v[3] <= v[2][1] for v in values) / RUNS
        se = [v[1] for v in values if v[1] is not None]
        good = abs(bias) <= 1 / 3 and 0.90 <= covered <= 0.98
        failed = failed or not good
        print(f"  {parameter:3} bias {bias:+.2f} sd, sd/se {sd / (sum(se) / len(se)):.2f}, covered {100 * covered:.0f} %"
              f"{'' if good else '  <- outside'}", flush=True)
sys.exit(failed)
