"""Does a program get what the command line prints? verbs_test.py IDENTIKAL LIBRARY

Every verb runs through both doors; their JSON is compared byte for byte but for what tells files and times."""
import csv
import json
import pathlib
import re
import subprocess
import sys
import tempfile

import library as ik

ROOT = pathlib.Path(__file__).resolve().parents[2]
TOOL, LIBRARY = sys.argv[1], ik.load(sys.argv[2])


def columns_of(path):
    rows = [r for r in csv.reader(line for line in open(path) if not line.startswith("#")) if r]
    header = [re.sub(r"\s*[\[(].*", "", name).strip() for name in rows[0]]
    units = [(re.search(r"[\[(](.*)[\])]", name) or [None, None])[1] for name in rows[0]]
    values = [[float(v) if v.strip() else float("nan") for v in row] for row in rows[1:]]
    return {name: [row[i] for row in values] for i, name in enumerate(header)}, dict(zip(header, units))


def without_files_and_times(text):
    result = json.loads(text)

    def cleaned(value, key=""):
        if key in ("path", "sha256", "timing_s", "text"):
            return None
        if isinstance(value, dict):
            return {k: cleaned(v, k) for k, v in value.items()}
        if isinstance(value, list):
            return [cleaned(v) for v in value]
        if isinstance(value, str):  # remarks name files
            return re.sub(r"<(recording|result|model)[^>]*>|[\w./+-]+\.(csv|yaml|json)|\S*/\w+", "FILE", value.replace(f"{ROOT}/", ""))
        return value

    return json.dumps(cleaned(result), indent=1, ensure_ascii=False)


def tool(*arguments):
    done = subprocess.run([TOOL, *map(str, arguments)], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def compare(what, code, text, result):
    if (code, without_files_and_times(text)) != (result.code, without_files_and_times(result.json)):
        ours, theirs = without_files_and_times(text).splitlines(), without_files_and_times(result.json).splitlines()
        differing = next((i for i, (a, b) in enumerate(zip(ours, theirs)) if a != b), min(len(ours), len(theirs)))
        sys.exit(f"{what}: codes {code} and {result.code} ({result.message});\n" + "\n".join(ours[differing - 2:differing + 2])
                 + "\n and\n" + "\n".join(theirs[differing - 2:differing + 2]))
    print(f"{what}: {len(text)} bytes, code {code}, equal")


with tempfile.TemporaryDirectory() as folder:
    folder = pathlib.Path(folder)
    nile_yaml, nile_csv = ROOT / "examples/nile.yaml", ROOT / "data/nile.csv"
    nile_text = nile_yaml.read_text()
    table, _ = columns_of(nile_csv)
    print(list(table))
    time, level = list(table)[0], list(table)[1]
    nile = ik.recording(table, [level], time=time)

    tuned = {}
    for options, arguments in (('{"starts": 1}', ["--starts", "1"]), ('{"method": "als"}', ["--method", "als"]),
                               ('{"starts": 2, "seed": 7, "hold-out": "30%", "set": ["q=900"]}',
                                ["--starts", "2", "--seed", "7", "--hold-out", "30%", "--set", "q=900"])):
        code, text, _ = tool("tune", nile_yaml, nile_csv, "--json", "-o", folder / "tuned", *arguments)
        tuned[options] = ik.run(LIBRARY, "tune", nile_text, [nile], options=options)
        compare("tune " + " ".join(arguments), code, text, tuned[options])
    tool("tune", nile_yaml, nile_csv, "--starts", "1", "-o", folder / "tuned")
    one = tuned['{"starts": 1}']
    for verb in ("check", "fit", "shape", "track"):
        code, text, _ = tool(verb, nile_yaml, nile_csv, "--json")
        compare(verb, code, text, ik.run(LIBRARY, verb, nile_text, [nile]))
    code, text, _ = tool("filter", nile_yaml, nile_csv, "--json", "--from", folder / "tuned", "--smooth")
    filtered = ik.run(LIBRARY, "filter", nile_text, [nile], previous=[one], options='{"smooth": true}')
    compare("filter", code, text, filtered)
    code, text, _ = tool("filter", nile_yaml, nile_csv, "--from", folder / "tuned", "--smooth")
    states = [[float(v) for v in row] for row in list(csv.reader(text.splitlines()))[1:]]
    for row, x, sd in zip(states, filtered.series("states"), filtered.series("state_sd")):
        assert abs(row[1] - x[0]) < 1e-6 * abs(row[1]) and abs(row[2] - sd[0]) < 1e-6 * row[2], (row, x, sd)
    code, text, _ = tool("validate", folder / "tuned", nile_csv, "--json")
    compare("validate", code, text, ik.run(LIBRARY, "validate", None, [nile], previous=[one]))
    code, text, _ = tool("bound", nile_yaml, "-n", "200", "--json")
    compare("bound", code, text, ik.run(LIBRARY, "bound", nile_text, options='{"rows": 200}'))
    code, text, _ = tool("compare", folder / "tuned", folder / "tuned", "--json")
    compare("compare", code, text, ik.run(LIBRARY, "compare", previous=[one, one]))
    code, text, _ = tool("simulate", nile_yaml, "-n", "50", "--seed", "3")
    simulated = ik.run(LIBRARY, "simulate", nile_text, options='{"rows": 50, "seed": 3}')
    assert simulated.json.splitlines()[-1] == text.splitlines()[-1] and len(simulated.series("simulated")) == 50
    print("simulate: equal")

    car_yaml, car_csv = ROOT / "examples/severe_lane_change.yaml", ROOT / "data/severe_lane_change.csv"
    drive, units = columns_of(car_csv)
    names = [name for name in drive if name != list(drive)[0]]
    car = ik.recording(drive, names, time=list(drive)[0], names=names, units=[units[n] for n in names])
    code, text, _ = tool("fit", car_yaml, car_csv, "--json", "--starts", "2")
    fitted = ik.run(LIBRARY, "fit", car_yaml.read_text(), [car], options='{"starts": 2}')
    compare("fit of a vehicle", code, text, fitted)
    tool("fit", car_yaml, car_csv, "--starts", "2", "-o", folder / "fitted")
    code, text, _ = tool("handling", folder / "fitted", car_csv, "--json")
    compare("handling of a result", code, text, ik.run(LIBRARY, "handling", None, [car], previous=[fitted]))
    code, text, _ = tool("handling", car_yaml, "--speed", "100 km/h", "--json")
    compare("handling of a model", code, text,
            ik.run(LIBRARY, "handling", car_yaml.read_text(), options='{"speed": "100 km/h"}'))

    # What an own program asks beyond: pages, progress, and a stop.
    assert one.page.startswith("<!") and len(one.page) > 50_000, one.page[:100]
    seen = []
    stopped = ik.run(LIBRARY, "tune", nile_text, [nile], progress=lambda user, what, share, value: seen.append(what) or 0)
    assert stopped.code in (0, 3) and len(seen) == 1, (stopped.code, seen)
    print("stopped:", stopped.message)
print("both doors agree")
