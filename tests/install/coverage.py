"""Which branches of what reads and writes files do the fast tests take?

coverage.py BUILD: compiles library, tests and program into BUILD, with gcc's counters in what reads and writes, or goes on with it, runs
the tests of readers and writers, and prints lines and branches of each file, those of exceptions left out (every call may throw). It decides nothing.
"""
import collections
import gzip
import json
import os
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
FILES = ["lib/data/*.cpp", "lib/data/internal/*.cpp", "lib/formula/expression.cpp", "identify/model/yaml_reader.cpp", "identify/model/model_file.cpp",
         "identify/model/included_files.cpp", "identify/model/matrix_reader.cpp", "identify/model/internal/*_form.cpp",
         "identify/model/internal/yaml_tree.cpp", "identify/result/*.cpp", "identify/result/internal/*.cpp", "jobs/inputs.cpp", "jobs/output_files.cpp",
         "jobs/folder_exchange.cpp", "jobs/quantity.cpp", "fleet/manifest.cpp", "fleet/store.cpp", "interface/json_options.cpp",
         "interface/recording_table.cpp", "command/option_parser.cpp"]
ROOMS = ["lib/data", "lib/formula", "identify/model", "identify/result", "jobs", "fleet", "interface"]
COMMANDS = ("^command_(bad_data|bad_input|check|compare|export|filter|fit|info|model|old_results|own_parameters|pseudo_measurement|references|report|"
            "simulate|treated|tune|validate)$|^fuzz")


def run(*command, **more):
    return subprocess.run([str(each) for each in command], check=True, **more)


def counted_files():
    return sorted({path for pattern in FILES for path in ROOT.glob(pattern)})


def tests():
    """Those of what is counted, by the names of their sources."""
    suites = {suite for room in ROOMS for path in (ROOT / "tests" / room).rglob("*.cpp") for suite in re.findall(r"^TEST(?:_F)?\((\w+),", path.read_text(), re.M)}
    return f"^({'|'.join(sorted(suites))})[.]|{COMMANDS}"


def compiled(build):
    if not (build / "CMakeCache.txt").exists():
        run("cmake", "-S", ROOT, "-B", build, "-G", "Ninja", "-DCMAKE_BUILD_TYPE=Release", "-DCMAKE_UNITY_BUILD=ON",
            "-DCMAKE_UNITY_BUILD_BATCH_SIZE=16", "-DIDENTIKAL_BUILD_TESTS=ON", "-DIDENTIKAL_BUILD_BENCH=OFF", "-DIDENTIKAL_BUILD_SLOW_TESTS=OFF",
            "-DIDENTIKAL_BUILD_PYTHON=OFF", "-DIDENTIKAL_COUNTED=" + ";".join(map(str, counted_files())))
    run("cmake", "--build", build, "-j", os.cpu_count() or 1)
    for counted in build.rglob("*.gcda"):
        counted.unlink()
    subprocess.run(["ctest", "--test-dir", build, "-R", tests(), "-LE", "slow", "-j", str(os.cpu_count() or 1)], check=False)


def counts(build):
    """{file: ({line: times}, {(line, place): times})} of all objects."""
    lines = collections.defaultdict(collections.Counter)
    branches = collections.defaultdict(collections.Counter)
    with tempfile.TemporaryDirectory() as folder:
        for counted in build.rglob("*.gcda"):
            run("gcov", "--json-format", "--branch-probabilities", counted, cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
            for made in pathlib.Path(folder).glob("*.gcov.json.gz"):
                with gzip.open(made) as file:
                    document = json.load(file)
                made.unlink()
                for each in document["files"]:
                    name = os.path.normpath(os.path.join(document["current_working_directory"], each["file"]))
                    for line in each["lines"]:
                        lines[name][line["line_number"]] += line["count"]
                        for place, branch in enumerate(line["branches"]):
                            if not branch["throw"]:
                                branches[name][line["line_number"], place] += branch["count"]
    return lines, branches


def share(times):
    return f"{sum(count > 0 for count in times.values()):5} of {len(times):5} {100.0 * sum(count > 0 for count in times.values()) / max(1, len(times)):5.1f} %"


def main():
    build = pathlib.Path(sys.argv[1]).resolve()
    compiled(build)
    lines, branches = counts(build)
    all_lines, all_branches = collections.Counter(), collections.Counter()
    print(f"{'file':48} {'lines':>22} {'branches':>22}")
    for name in counted_files():
        of_lines, of_branches = lines[str(name)], branches[str(name)]
        all_lines.update({(name, key): count for key, count in of_lines.items()})
        all_branches.update({(name, key): count for key, count in of_branches.items()})
        print(f"{str(name.relative_to(ROOT)):48} {share(of_lines):>22} {share(of_branches):>22}")
    print(f"{'all':48} {share(all_lines):>22} {share(all_branches):>22}")


if __name__ == "__main__":
    main()
