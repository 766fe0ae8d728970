"""Does every test that docs/guarantees.md names exist?"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parents[1]
PAGE = (ROOT / "docs/guarantees.md").read_text()
LISTED = (ROOT / "tests/CMakeLists.txt").read_text()
CPP = "\n".join(p.read_text() for p in (ROOT / "tests").rglob("*_test.cpp"))


def exists(name):
    if ": " in name:
        file, test = name.split(": ")
        return any(re.search(rf"def {re.escape(test)}\(", path.read_text()) for path in (ROOT / "tests").rglob(file))
    if "." in name:
        suite, test = name.split(".")
        return re.search(rf"TEST(_F|_P)?\({suite}, {test}\)", CPP) is not None
    if name.startswith("fuzz_"):
        return re.search(rf"set\(fuzz_targets [a-z_ ]*\b{name[5:]}\b", LISTED) is not None
    return re.search(rf"NAME {name}\b", LISTED) is not None


def main():
    rows = [line for line in PAGE.splitlines() if line.startswith("| ") and not line.startswith(("| promise", "| limit"))]
    missing = []
    for row in rows:
        names = re.findall(r"`([^`]+)`", row.rsplit("|", 2)[1])
        names = [name for name in names if not name.startswith("./")]
        if not names:
            missing.append(f"no test: {row}")
        missing += [f"no such test: {name}" for name in names if not exists(name)]
    print(f"{len(rows)} promises")
    print("\n".join(missing), end="\n" if missing else "")
    return 1 if missing else 0


if __name__ == "__main__":
    sys.exit(main())
