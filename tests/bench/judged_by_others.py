"""The tables of docs/judged-by-others.md and when-is-it-ok.md again, where the problems of others lie.

judged_by_others.py TOOL [NAME ...]; IDENTIKAL_OTHERS names the folder that has them, each as a folder of its own:

    problems/run_all.py TOOL              public nonlinear problems
    peers/run_all.py TOOL                 tests of other programs; writes table.csv to OUT
    filters/run_all.py --tool TOOL        filters with true states
    simulators/evaluate.py --tool TOOL    cars of other simulators, in recordings.tar.xz
    benchmarks/                           DaISy, Silverbox, coupled drives, for the benches of this folder

None of it is part of the project. Without the variable: exit 77, skipped. Exit 1 where a script fails; what the tables say
decides nothing here.
"""
import os
import pathlib
import subprocess
import sys
import tarfile
import tempfile

HERE = pathlib.Path(__file__).resolve().parent


def commands(others, tool, work):
    python = sys.executable
    yield "problems", [python, others / "problems/run_all.py", tool]
    yield "peers", [python, others / "peers/run_all.py", tool]
    yield "filters", [python, others / "filters/run_all.py", "--tool", tool, "--out", work]
    yield "simulators", [python, others / "simulators/evaluate.py", "--tool", tool, work / "cars"]
    for bench, *more in (("daisy",), ("silverbox", "3000"), ("coupled_drives",)):
        yield bench, [python, HERE / f"{bench}.py", tool, others / "benchmarks", *more]


def main():
    others = os.environ.get("IDENTIKAL_OTHERS")
    if not others:
        print("IDENTIKAL_OTHERS is not set")
        return 77
    others, tool, wanted = pathlib.Path(others).resolve(), pathlib.Path(sys.argv[1]).resolve(), sys.argv[2:]
    failed = []
    with tempfile.TemporaryDirectory() as folder:
        work = pathlib.Path(folder)
        for name, command in commands(others, tool, work):
            if wanted and name not in wanted or not command[1].exists():
                continue
            print(f"== {name}", flush=True)
            if name == "simulators":
                with tarfile.open(others / "simulators/recordings.tar.xz") as recordings:
                    recordings.extractall(work / "cars")
            done = subprocess.run(command, cwd=work, env={**os.environ, "OUT": str(work)}, check=False)
            failed += [name] if done.returncode else []
    print(f"failed: {', '.join(failed) or 'none'}")
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
