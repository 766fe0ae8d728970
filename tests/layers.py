"""The rule of the house: a room includes only rooms below it, and nobody else's internal/ folder.

A room is a folder with sources of its own. ORDER lists the rooms from the ground up; the floor of a room is the longest way down from it
within its house. Prints rooms, floors and includes; fails on an include that runs up (and so on every circle), on an include of
another room's internal/ header, on too many floors, on a third-party header outside its one place, on a test that is not built, and on a
type of the namespace identikal that two headers define: the linker would take one's functions for the other's.
"""
import collections
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
ORDER = {
    # lib/internal: what all rooms of lib share and nobody else sees.
    "lib": ["internal", "", "base", "data", "formula", "model", "filter", "nonlinear", "statistics", "subspace", "polynomial", "regression", "vehicle"],
    "solvers": [""],
    "identify": ["estimate", "population", "model", "result", "survey", "regression", "shooting", "filter", "report", "noise", "colour", "black_box", "vehicle", "handling",
                 "simulation", "validation", "optimality"],
    "studies": [""],
    "jobs": [""],
    "fleet": [""],
    "interface": [""],
    "command": [""],
    "python": [""],
}
MOST_FLOORS = 7
# Headers of these libraries stay behind single files, so that the rest compiles fast and can do without them.
ONLY_IN = {
    r"ceres/": r"solvers/(ceres_backend|sparse_least_squares|internal/ceres_options)\.(cpp|h)",
    r"nlopt": r"solvers/nlopt_backend\.cpp",
    r"hwy/": r"lib/(filter/internal/(simd_kernels|bank_kernel|tangent_kernel)|nonlinear/internal/extended_kernel)\.cpp",
    r"pybind11/": r"python/.*",
    r"CLI/": r"command/.*",
    r"mpi\.h": r"fleet/internal/mpi_plugin\.cpp",
    r"sqlite3": r"fleet/internal/database\.cpp",
    r"nlohmann/": r"(fleet/.*\.cpp|identify/(result|report)/(.*\.cpp|internal/.*\.h)|interface/.*\.cpp)",
    r"yaml-cpp/": r"identify/model/yaml_reader\.cpp",
    r"boost/": r"identify/estimate/distribution\.cpp",
    r"openssl/": r"identify/result/file_digest\.cpp",
    r"fmt/": r"(identify|studies|jobs|fleet|interface|command)/.*\.cpp",
}

place = {f"{house}/{room}".rstrip("/"): (i, j)
         for i, (house, rooms) in enumerate(ORDER.items()) for j, room in enumerate(rooms)}


def room_of(path):
    """The room of a file: its folder without internal/, but lib/internal is a room."""
    folder = path.rsplit("/", 1)[0]
    return folder if folder in place else folder.removesuffix("/internal")


faults, files = [], collections.Counter()
uses = collections.defaultdict(set)  # room -> rooms that it includes
defined = collections.defaultdict(list)  # type -> headers
for house in ORDER:
    for path in sorted((ROOT / house).rglob("*")):
        if path.suffix not in (".h", ".cpp"):
            continue
        name = path.relative_to(ROOT).as_posix()
        room = room_of(name)
        if room not in place:
            faults.append(f"{name}: {room} is not a room; tests/layers.py lists them")
            continue
        files[room] += 1
        if path.suffix == ".h":
            for kind in re.findall(r"^(?:struct|class|enum class) (\w+)[^;\n]*\{", path.read_text(), re.M):
                defined[kind].append(name)
        for number, line in enumerate(path.read_text().splitlines(), 1):
            include = re.match(r'\s*#\s*include\s*([<"])([^>"]+)[>"]', line)
            if not include:
                continue
            where, header = f"{name}:{number}: includes {include[2]}", include[2]
            if include[1] == '"':
                other = room_of(header)
                if other not in place:
                    faults.append(f"{where}, which lies in no room")
                    continue
                if other != room:
                    uses[room].add(other)
                if place[other] > place[room]:
                    faults.append(f"{where}, which lies above")
                owner = header.split("/internal/")[0]
                if "/internal/" in header and not name.startswith(owner + "/"):
                    faults.append(f"{where}, which is internal to {owner}")
                if "/internal/" in header and name.endswith(".h") and "/internal/" not in name:
                    faults.append(f"{where}: a header that is installed, one that is not")
            for pattern, only in ONLY_IN.items():
                if re.match(pattern, header) and not re.fullmatch(only, name):
                    faults.append(f"{where}; it belongs into {only} only")

floor = {}
for room in sorted(place, key=place.get):
    house = room.split("/")[0]
    floor[room] = 1 + max((floor[o] for o in uses[room] if o.split("/")[0] == house and o in floor), default=0)
    if files[room]:
        print(f"{room:22} floor {floor[room]}  {files[room]:3} files  includes {', '.join(sorted(uses[room], key=place.get)) or 'nothing'}")
for house in ORDER:
    floors = max((floor[r] for r in floor if r.split("/")[0] == house and files[r]), default=0)
    print(f"{house}: {floors} floors")
    if floors > MOST_FLOORS:
        faults.append(f"{house} has {floors} floors; at most {MOST_FLOORS}")
faults += [f"{headers[1]}: defines {kind}, as {headers[0]} does" for kind, headers in defined.items() if len(headers) > 1]
built = (ROOT / "tests/CMakeLists.txt").read_text()
for test in sorted([*ROOT.glob("tests/**/*_test.cpp"), *ROOT.glob("tests/**/*_study.cpp")]):
    if test.relative_to(ROOT / "tests").as_posix() not in built:
        faults.append(f"{test.relative_to(ROOT)}: no test program is built from it")
up = sum("lies above" in fault for fault in faults)
print(*faults, sep="\n")
print(f"{sum(files.values())} files in {len(files)} rooms, {up} includes up, {len(faults)} faults")
sys.exit(bool(faults))
