"""Published tables and figures rerun, and compared with what tests/golden/studies keeps of them.

published_figures.py IDENTIKAL                  what takes seconds
published_figures.py IDENTIKAL --all            everything, with the published number of runs
published_figures.py IDENTIKAL --all --write    writes tests/golden/studies again (two minutes per core and more)

Words must be the same; a printed number may differ by one unit of its last digit, as another compiler rounds elsewhere."""
import pathlib
import re
import subprocess
import sys

GOLDEN = pathlib.Path(__file__).resolve().parents[1] / "golden" / "studies"
TABLES = [f"matisko-table-{n}" for n in range(3, 14)]
# Name of the golden file: arguments.
SMALL = {
    "matisko-table-7-3-runs": ["matisko-table-7", "--runs", "3"],
    "matisko-table-10-2-runs": ["matisko-table-10", "--runs", "2"],
    "matisko-table-13-2-runs": ["matisko-table-13", "--runs", "2"],
    "matisko-figure-14-2-runs": ["matisko-figure-14", "--runs", "2"],
    "matisko-figure-1-50-runs": ["matisko-figure-1", "--runs", "50"],
    **{f"matisko-figure-{n}": [f"matisko-figure-{n}"] for n in range(4, 14)},
    **{f"sladka-figure-9.{n}": [f"sladka-figure-9.{n}"] for n in range(1, 10)},
    "sladka-logarithm-10-runs": ["sladka-logarithm", "--runs", "10"],
}
LARGE = {
    **{name: [name] for name in TABLES + [f"matisko-figure-{n}" for n in (1, 2, 3, 14, 15)]},
    "sladka-logarithm": ["sladka-logarithm"],
    **{f"matisko-table-{n}-200-runs": [f"matisko-table-{n}", "--runs", "200"] for n in (1, 2)},
}
NUMBER = re.compile(r"-?\d+(?:\.\d+)?(?:e[+-]?\d+)?")


def unit(number):
    """Of the last digit that is printed."""
    mantissa, _, exponent = number.partition("e")
    return 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def difference(ours, golden):
    if len(ours.splitlines()) != len(golden.splitlines()):
        return f"{len(ours.splitlines())} lines, {len(golden.splitlines())} expected"
    for n, (a, b) in enumerate(zip(ours.splitlines(), golden.splitlines()), 1):
        # A number that grows by a digit takes a blank before it.
        words_a, words_b = (re.sub(r"\s+", " ", NUMBER.sub("#", line)) for line in (a, b))
        same = words_a == words_b
        for x, y in zip(NUMBER.findall(a), NUMBER.findall(b)):
            same = same and abs(float(x) - float(y)) <= 1.01 * max(unit(x), unit(y))
        if not same:
            return f"line {n}:\n  {a}\n  {b} expected"
    return ""


def main(identikal, *options):
    cases = {**SMALL, **LARGE} if "--all" in options else SMALL
    failed = False
    for name, arguments in cases.items():
        ours = subprocess.run([identikal, "study", *arguments, "--quiet"], check=True, capture_output=True, text=True).stdout
        path = GOLDEN / f"{name}.txt"
        if "--write" in options:
            path.write_text(ours)
        what = difference(ours, path.read_text())
        print(f"{name}: {what or 'as kept'}", flush=True)
        failed = failed or bool(what)
    return failed


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
