"""Whatever call fails while a job runs: faults_test.py PROGRAM LIBRARY [FAULTS]

Every verb is run with a call of the system that fails, by tests/fault/inject.cpp: the n-th one, or all from the n-th on. Each time
the exit code is one of the documented ones, standard error has one line where it was not before, the result's folder is
the one of before or the whole new one, and what is said to be done is what is done without a fault. Without one, every file that is named, or included, is opened once."""
import collections
import concurrent.futures
import json
import os
import pathlib
import random
import re
import shutil
import subprocess
import sys
import tempfile
import threading

PROGRAM, LIBRARY = (str(pathlib.Path(path).resolve()) for path in sys.argv[1:3])
FAULTS = int(sys.argv[3]) if len(sys.argv) > 3 else 400
ROOT = pathlib.Path(__file__).resolve().parents[2]
KINDS = ["memory", "open", "read", "write", "rename", "sync", "folder", "link", "thread"]

LEVEL = """identikal: 1
time: {kind: discrete, step: 1 s}
outputs: {y: {}}
parameters: {q: {value: 1, min: 0, max: 1e6}, r: {value: 1, min: 0, max: 1e6}}
A: [[1]]
C: [[1]]
Q: [[q]]
R: [[r]]
initial: diffuse
"""
INCLUDING = "include: base.yaml\nname: with a base\n"
FORMULA = """identikal: 1
time: {kind: continuous, column: t, unit: s}
states: [x]
dynamics: {x: -k*x + u}
inputs: {u: {}}
outputs: {y: {equals: x^2}}
parameters: {k: {value: 1, min: 0, max: 5}}
noise: {process: density}
Q: [[0.1]]
R: [[0.01]]
initial: {x: {mean: 1, sd: 1}}
"""
CAR = (ROOT / "examples/severe_lane_change.yaml").read_text()


def rows(count, seed):
    source = random.Random(seed)
    level, out = 0.0, ["y"]
    for _ in range(count):
        level += source.gauss(0, 1)
        out.append(f"{level + source.gauss(0, 1):.4f}")
    return "\n".join(out) + "\n"


def formula_rows(count):
    source = random.Random(3)
    return "t,u,y\n" + "".join(f"{k / 10},{source.gauss(0, 1):.3f},{1 + source.gauss(0, 0.1):.3f}\n" for k in range(count))


def prepare(folder):
    for name, text in (("level.yaml", LEVEL), ("base.yaml", LEVEL), ("including.yaml", INCLUDING), ("formula.yaml", FORMULA),
                       ("car.yaml", CAR), ("level.csv", rows(80, 1)), ("other.csv", rows(30, 2)), ("long.csv", rows(700, 3)), ("formula.csv", formula_rows(30))):
        (folder / name).write_text(text)
    shutil.copy(ROOT / "data/severe_lane_change.csv", folder / "car.csv")
    shutil.copytree(ROOT / "tests/golden/result_v1/nile", folder / "nile")
    for name, data in (("a", "level.csv"), ("b", "level.csv"), ("old", "other.csv")):
        subprocess.run([PROGRAM, "tune", "level.yaml", data, "-o", name, "--report", name + "/page.html", "--starts", "1"], cwd=folder,
                       capture_output=True)
    subprocess.run([PROGRAM, "fleet", "tune", "level.yaml", "level.csv", "other.csv", "-o", "fleet"], cwd=folder, capture_output=True)


# Those that write have the folder "out", which holds an earlier result.
JOBS = [
    "tune level.yaml level.csv -o out --quiet",
    "tune including.yaml level.csv -o out --report out/page.html --quiet --threads 2",
    "tune level.yaml level.csv --method als --json",
    "tune level.yaml level.csv --hold-out other.csv -o fresh --quiet",
    "fit formula.yaml formula.csv --starts 1 -o out --quiet",
    "fit car.yaml car.csv -o out --quiet",
    "check level.yaml level.csv -o out",
    "track level.yaml level.csv -o out --quiet --particles 20",
    "filter level.yaml level.csv -o out --smooth",
    "filter level.yaml level.csv --from a",
    "shape level.yaml level.csv --order 1 -o out --quiet",
    "bound level.yaml --rows 50 -o out",
    "simulate level.yaml -n 50 -o out",
    "simulate level.yaml -n 50",
    "forecast level.yaml level.csv -n 5 -o out",
    "validate a other.csv",
    "compare a b",
    "handling car.yaml --speed 80",
    "model formula.csv --output y --input u",
    "info level.csv",
    "info car.csv --vehicle",
    "init pendulum",
    "report a --report out/page.html",
    "export a --to python",
    "export a --to yaml",
    "digest level.yaml long.csv -o out.digest",
    "study sladka-figure-9.2 -o out",
    "fleet status fleet",
    "fleet export fleet",
    "fleet tune level.yaml level.csv other.csv -o drives --threads 1",
]


def content(folder, name):
    """Files with their contents, without the time that a job took; None where there is no folder."""
    path = folder / name
    if not path.exists():
        return None
    if path.is_file():
        return re.sub(rb'"timing_s":[^,}\n]*', b"", path.read_bytes())
    return {p.relative_to(path).as_posix(): re.sub(rb'"timing_s":[^,}\n]*', b"", p.read_bytes()) for p in sorted(path.rglob("*")) if p.is_file()}


def outputs(folder, job):
    words = job.split()
    names = {words[k + 1].split("/")[0] for k, word in enumerate(words) if word in ("-o", "--report")}
    return {name: content(folder, name) for name in names if name != "drives"}  # a store says when: see resumed()


def resumed(place):
    """What has become of a fleet's store is either nothing or something to go on from."""
    if not (place.path / "drives").exists():
        return ""
    done = place.run("fleet resume drives")
    whole = done.returncode in (0, 1, 2, 3) and done.stderr.count(b"\n") <= 1 and b"internal error" not in done.stderr
    return "" if whole else f"resume: exit {done.returncode}: {done.stderr.decode(errors='replace')}"


class Place:
    """A folder for one worker, which is put back after each run."""

    def __init__(self, master):
        self.path = pathlib.Path(tempfile.mkdtemp(prefix="faults"))
        self.master = master
        self.clean()

    def clean(self):
        for entry in self.path.iterdir():
            shutil.rmtree(entry) if entry.is_dir() else entry.unlink()
        for entry in self.master.iterdir():
            if entry.name in ("old", "fleet", "a", "b", "nile"):
                continue
            os.link(entry, self.path / entry.name)
        for name in ("a", "b", "fleet"):
            copy = shutil.copytree if (self.master / name).is_dir() else shutil.copy
            copy(self.master / name, self.path / name)
        shutil.copytree(self.master / "old", self.path / "out")

    def put_back(self, job):
        words = job.split()
        for k, word in enumerate(words):
            if word not in ("-o", "--report"):
                continue
            target = self.path / words[k + 1].split("/")[0]
            if target.is_dir():
                shutil.rmtree(target)
            elif target.exists():
                target.unlink()
            if target.name == "out":
                shutil.copytree(self.master / "old", target)
        for entry in self.path.iterdir():
            if entry.name.startswith("."):
                shutil.rmtree(entry) if entry.is_dir() else entry.unlink()

    def run(self, job, **more):
        environment = {**os.environ, "LD_PRELOAD": LIBRARY, **more}
        return subprocess.run([PROGRAM, *job.split()], cwd=self.path, capture_output=True, env=environment, timeout=120)


class Campaign:
    def __init__(self, folder):
        self.master = folder / "master"
        self.master.mkdir()
        prepare(self.master)
        self.local = threading.local()
        self.places = []
        self.known = {}
        self.twice = []

    def place(self):
        if not hasattr(self.local, "place"):
            self.local.place = Place(self.master)
            self.places.append(self.local.place)
        return self.local.place

    def learn(self, job):
        place = self.place()
        before = outputs(place.path, job)
        counts = place.path / "counts"
        done = place.run(job, FAULT_COUNTS=str(counts))
        assert done.returncode in (0, 1, 3), f"{job}: exit {done.returncode}, {done.stderr.decode()}"
        lines = counts.read_text().splitlines()
        called = {line.split()[0]: int(line.split()[1]) for line in lines[:len(KINDS)]}
        opened = collections.Counter(lines[len(KINDS):])
        self.twice += [f"{job}: opens {path} {n} times" for path, n in opened.items() if n > 1 and self.is_named(path, job, place)]
        counts.unlink()
        self.known[job] = (done.returncode, done.stdout, done.stderr.count(b"\n"), before, outputs(place.path, job), called)
        place.put_back(job)

    def is_named(self, path, job, place):
        """Files that the command line names, and what they include."""
        named = {word for word in job.split() if (place.path / word).exists()}
        if "including.yaml" in named:
            named.add("base.yaml")
        return path in named or any(path.startswith(name + "/") for name in named) and (place.path / path).is_file()

    def faults(self, count):
        """Every call that is not for memory, once and from then on; then requests of memory, by chance."""
        source = random.Random(11)
        out = [(job, f"{kind}:{n}{more}") for job, known in self.known.items() for kind, calls in known[5].items()
               if kind != "memory" for n in range(1, min(calls, 40) + 1) for more in ("", "+")]
        source.shuffle(out)
        out = out[:count // 2]
        jobs = list(self.known)
        while len(out) < count:
            job = source.choice(jobs)
            calls = self.known[job][5]["memory"]
            n = source.randint(1, calls) if source.random() < 0.7 else min(calls, 1 + int(source.expovariate(1 / 300)))
            out.append((job, f"memory:{n}{source.choice(['', '+'])}"))
        return out

    def wrong(self, job, fault):
        place = self.place()
        code, _, lines, before, after, _ = self.known[job]
        try:
            done = place.run(job, FAULT=fault)
        except subprocess.TimeoutExpired:
            return "hangs"
        now = outputs(place.path, job)
        store = resumed(place)
        hidden = [p.name for p in place.path.rglob(".*")]
        place.put_back(job)
        said = done.stderr.decode(errors="replace")
        if not 0 <= done.returncode <= 5:
            return f"exit {done.returncode}: {said[-200:]}"
        if "internal error" in said:
            return said
        if store:
            return store
        for name, files in now.items():
            if files not in (before[name], after[name]):
                return f"{name} is neither the old nor the new one: {said}"
        if done.returncode == code:
            return "" if now == after else f"exit {code}, and not all is written: {said}"
        if job.startswith("fleet tune") and done.returncode in (2, 3) and not said:
            return ""  # recordings could not be read: the table says so
        if done.returncode not in (2, 5):
            return f"exit {done.returncode} instead of {code}: {said}"
        if said.count("\n") != lines + 1 or "identikal: " not in said:
            return f"not one line: {said!r}"
        return f"left behind: {hidden}" if hidden else ""


def main():
    with tempfile.TemporaryDirectory() as folder:
        campaign = Campaign(pathlib.Path(folder))
        for job in JOBS:
            campaign.learn(job)
        bad, codes = collections.defaultdict(list), collections.Counter()
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
            faults = campaign.faults(FAULTS)
            for (job, fault), why in zip(faults, workers.map(lambda each: campaign.wrong(*each), faults)):
                codes[fault.split(":")[0]] += 1
                if why:
                    bad[job].append(f"FAULT={fault}: {why.strip()}")
        for place in campaign.places:
            shutil.rmtree(place.path)
    for text in campaign.twice:
        print(text)
    print(f"{sum(codes.values())} faults:", ", ".join(f"{kind} {codes[kind]}" for kind in KINDS), f"; wrong: {sum(map(len, bad.values()))}")
    for job, faults in bad.items():
        print(f"{job}  ({len(faults)})")
        for text in faults[:4]:
            print("   ", text[:400])
    return 1 if bad or campaign.twice else 0


if __name__ == "__main__":
    sys.exit(main())
