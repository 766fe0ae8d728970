#!/usr/bin/env python3
"""Bias and coverage of the estimates on the templates whose dynamics nobody solves by hand.

templates_study.py IDENTIKAL [RUNS [NAME...]]

Asked: |bias| <= sd/3 for every parameter, and 95 % intervals that a joint binomial test does not reject at 1 %
(Bonferroni over all parameters of all templates). By chance alone a bias of 1/3 sd has a share below 1e-5 of
200 recordings. Every search begins once, with the physical values to be estimated 10 or 20 % off.
"""
import json
import math
import os
import pathlib
import shlex
import subprocess
import sys
import tempfile
from concurrent.futures import ThreadPoolExecutor

from templates_test import commands, truth

identikal = str(pathlib.Path(sys.argv[1]).resolve())
RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 200
# What begins off its true value, and by which factor.
OFF = {
    "pendulum": (1.2, ["l", "d"]),
    "battery": (1.2, ["Q", "R0", "R1", "C1"]),
    "single-track": (1.2, ["Iz", "Cf", "Cr"]),
    "single-track-bank": (1.2, ["Iz", "Cf", "Cr", "offset"]),
    "single-track-low-speed": (1.1, ["Iz", "Cf", "Cr", "ratio"]),
    "single-track-roll": (1.2, ["Iz", "Cf", "Cr", "K", "D", "loss"]),
    "single-track-trailer": (1.2, ["Iz", "Cf", "Cr", "Ct"]),
    "steering-actuator": (1.2, ["delay", "frequency", "damping", "dead", "limit"]),
    "vector-sensors": (1.1, ["Iz", "Cf", "Cr", "xf", "xr"]),
    "track-on-map": (1.2, ["angle"]),
}
NAMES = sys.argv[3:] or list(OFF)


def run(name, seed):
    text = subprocess.run([identikal, "init", name], capture_output=True, text=True, check=True).stdout
    factor, unknown = OFF[name]
    with tempfile.TemporaryDirectory() as folder:
        steps = [step.replace("identikal", shlex.quote(identikal), 1) for step in commands(text)]
        quiet = {"shell": True, "cwd": folder, "capture_output": True, "text": True}
        subprocess.run(steps[0], check=True, **quiet)
        subprocess.run(f"{steps[1]} --seed {seed}", check=True, **quiet)
        known = truth(pathlib.Path(folder) / "demo" / "simulated.csv")
        off = " ".join(f"--set {p}={factor * known[p]}" for p in unknown)
        fit = subprocess.run(f"{steps[2]} --json --quiet --starts 1 {off}", **quiet)
    result = json.loads(fit.stdout)
    profile = lambda p: p.get("profile95") or [None]
    return {p["name"]: (p["value"], p["se"], p["ci95"] if profile(p)[0] is None else profile(p), known[p["name"]], fit.returncode)
            for p in result["parameters"] if not p["fixed"] and p["name"] in known}


def chance(covered, runs, share=0.95):
    """Two-sided probability of a coverage as far off, were it `share`."""
    log = lambda k: (math.lgamma(runs + 1) - math.lgamma(k + 1) - math.lgamma(runs - k + 1) + k * math.log(share)
                     + (runs - k) * math.log(1 - share))
    here = log(covered)
    return min(1.0, sum(math.exp(log(k)) for k in range(runs + 1) if log(k) <= here + 1e-9))


failed, least, parameters = False, 1.0, 0
for name in NAMES:
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        runs = list(pool.map(lambda seed: run(name, seed), range(1, RUNS + 1)))
    print(f"{name}: {RUNS} recordings, {sum(list(r.values())[0][4] == 0 for r in runs)} with status ok")
    for parameter in runs[0]:
        values = [r[parameter] for r in runs]
        mean = sum(v[0] for v in values) / RUNS
        sd = math.sqrt(sum((v[0] - mean) ** 2 for v in values) / (RUNS - 1))
        bias = (mean - values[0][3]) / sd
        said = [v for v in values if v[2][0] is not None]  # the others say that they have no errors
        covered = sum(v[2][0] <= v[3] <= v[2][1] for v in said)
        p = chance(covered, len(said))
        least, parameters = min(least, p), parameters + 1
        se = [v[1] for v in values if v[1] is not None]
        failed = failed or abs(bias) > 1 / 3
        print(f"  {parameter:10} bias {bias:+.2f} sd, sd/se {sd / (sum(se) / len(se)):.2f}, covered "
              f"{100 * covered / len(said):.1f} % of {len(said)} (p {p:.2g}){'' if abs(bias) <= 1 / 3 else '  <- biased'}", flush=True)
joint = min(1.0, parameters * least)
print(f"joint test of {parameters} coverages: p {joint:.2g}")
sys.exit(failed or joint < 0.01)
