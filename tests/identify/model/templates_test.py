#!/usr/bin/env python3
"""Every template of `identikal init`: the commands in its comment, literally, and the truth within the errors.

templates_test.py IDENTIKAL [NAME...]

One parameter in 15 000 lies outside four standard errors by chance; there are some eighty.
"""
import json
import pathlib
import re
import shlex
import subprocess
import sys
import tempfile
import time


def commands(text):
    """The commands of the comment, continued lines joined."""
    found, going = [], False
    for line in text.splitlines():
        match = re.match(r"#   (identikal .*|  .*)$", line)
        if not match:
            going = False
            continue
        part = match.group(1).split("   # ")[0].strip()
        if going:
            found[-1] += " " + part
        else:
            found.append(part)
        going = found[-1].endswith("\\")
        if going:
            found[-1] = found[-1][:-1].strip()
    return found


def truth(csv):
    out = {}
    for line in csv.read_text().splitlines():
        match = re.match(r"# truth: (\S+) = (\S+)", line)
        if match:
            out[match.group(1)] = float(match.group(2))
    return out


def check(identikal, name, folder):
    text = subprocess.run([identikal, "init", name], capture_output=True, text=True, check=True).stdout
    steps = commands(text)
    faults = []
    if len(steps) != 3 or not steps[0].startswith("identikal init " + name):
        return [f"three commands expected, found {steps}"]
    began = time.monotonic()
    for step in steps[:2]:
        step = step.replace("identikal", shlex.quote(identikal), 1)
        made = subprocess.run(step, shell=True, cwd=folder, capture_output=True, text=True)
        if made.returncode != 0:
            return [f"exit {made.returncode}: {made.stderr.strip()}"]
    run = subprocess.run(steps[2].replace("identikal", shlex.quote(identikal), 1) + " -o out --json", shell=True,
                         cwd=folder, capture_output=True, text=True)
    if run.returncode != 0:
        faults.append(f"exit {run.returncode}: {run.stderr or json.loads(run.stdout)['status']}")
    if not run.stdout:
        return faults
    known, worst = truth(folder / "demo" / "simulated.csv"), 0.0
    for parameter in json.loads(run.stdout)["parameters"]:
        made = parameter["name"].startswith("var_") or parameter["name"].endswith("_start")  # by --objective simulation
        if parameter["fixed"] or made:
            continue
        if parameter["se"] is None:
            faults.append(f"{parameter['name']} has no error")
            continue
        off = (parameter["value"] - known[parameter["name"]]) / parameter["se"]
        worst = max(worst, abs(off))
        if abs(off) > 4.0:
            faults.append(f"{parameter['name']} is {parameter['value']}, {off:.1f} errors off {known[parameter['name']]}")
    print(f"{name}: worst {worst:.2f} errors, {time.monotonic() - began:.1f} s", flush=True)
    return faults


def main():
    identikal = str(pathlib.Path(sys.argv[1]).resolve())
    listed = subprocess.run([identikal, "init"], capture_output=True, text=True, check=True).stdout
    names = sys.argv[2:] or [line for line in listed.splitlines() if line and not line.startswith(" ") and not line.endswith(":")]
    failed = False
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            for fault in check(identikal, name, pathlib.Path(folder)):
                print(f"  {name}: {fault}", flush=True)
                failed = True
    print(f"{len(names)} templates")
    sys.exit(1 if failed or len(names) < 21 and len(sys.argv) < 3 else 0)


if __name__ == "__main__":
    main()
