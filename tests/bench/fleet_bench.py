"""How fast is a fleet? Series of a local level, drives of a car; beside a loop of the single command.

    python3 tests/bench/fleet_bench.py build/identikal [SERIES] [DRIVES]
"""
import os
import pathlib
import random
import resource
import subprocess
import sys
import tempfile
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
SERIES = int(sys.argv[2]) if len(sys.argv) > 2 else 10000
DRIVES = int(sys.argv[3]) if len(sys.argv) > 3 else 200
LEVEL = (ROOT / "examples/nile.yaml").read_text().replace("column: volume", "column: y")


def timed(*arguments):
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    begin = time.monotonic()
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    if done.returncode not in (0, 1):
        sys.exit(f"{arguments}: {done.stdout}{done.stderr}")
    return time.monotonic() - begin, after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime, done.stdout


def series():
    """Files of 1000 series of 1000 samples, which is how a million of them would be kept."""
    import numpy as np
    rng = np.random.default_rng(7)
    os.mkdir("series")
    for file in range(max(1, SERIES // 1000)):
        count = min(SERIES, 1000)
        y = np.cumsum(rng.normal(size=(count, 1000)), axis=1) + 2 * rng.normal(size=(count, 1000))
        with open(f"series/{file:05}.csv", "w") as out:
            out.write("series,y\n")
            for k in range(count):
                out.writelines(f"{k},{v:.3f}\n" for v in y[k])
    pathlib.Path("level.yaml").write_text(LEVEL.replace("1000, min", "1, min"))
    for options in [(), ("--no-profiles", "--starts", 1)]:
        store = f"series{len(options)}.store"
        wall, cpu, _ = timed("fleet", "tune", "level.yaml", "series", "--by", "series", "-o", store, "--quiet", *options)
        print(f"{SERIES} series of 1000 samples {' '.join(map(str, options)) or 'with profiles'}: {wall:.1f} s ({SERIES / wall:.0f}/s, "
              f"10^6 in {wall / SERIES * 1e6 / 60:.1f} min), {cpu:.0f} s of processors, store {os.path.getsize(store) / SERIES:.0f} bytes a row")
    peak = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss
    print(f"largest process {peak / 1024:.0f} MB")


def drives():
    os.mkdir("drives")
    model = ROOT / "examples/severe_lane_change.yaml"
    rng = random.Random(3)
    for k in range(DRIVES):
        subprocess.run([PROGRAM, "simulate", str(model), "--manoeuvre", "weave", "--duration", "60", "--rate", "20 Hz", "--snr", "30dB", "--seed", str(rng.randrange(10**6)), "-o", f"d{k}"],
                       capture_output=True)
        if not os.path.exists(f"d{k}/simulated.csv"):
            subprocess.run([PROGRAM, "simulate", str(model), str(ROOT / "data/severe_lane_change.csv"), "--seed", str(k + 1), "-o", f"d{k}"], check=True, capture_output=True)
        os.rename(f"d{k}/simulated.csv", f"drives/{k:05}.csv")
    wall, cpu, _ = timed("fleet", "fit", model, "drives", "-o", "drives.store", "--quiet")
    begin = time.monotonic()
    few = min(DRIVES, 50)
    for k in range(few):
        subprocess.run([PROGRAM, "fit", str(model), f"drives/{k:05}.csv", "-o", f"single{k}"], capture_output=True)
    single = (time.monotonic() - begin) / few
    print(f"{DRIVES} drives: {wall:.2f} s, {DRIVES / wall:.1f}/s; a loop of the single command {1 / single:.1f}/s: {single * DRIVES / wall:.2f} times")


with tempfile.TemporaryDirectory() as folder:
    os.chdir(folder)
    series()
    drives()
