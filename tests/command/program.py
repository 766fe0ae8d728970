"""The program as its tests run it: IDENTIKAL is its path, or the first argument."""
import csv
import json
import os
import pathlib
import subprocess
import sys
import tempfile
import unittest

import jsonschema

PROGRAM = os.environ.get("IDENTIKAL") or sys.argv.pop(1)
ROOT = pathlib.Path(__file__).resolve().parents[2]
SHARED = ROOT.parent / "shared"
SCHEMA = json.loads((ROOT / "identify/result/result.schema.json").read_text())
NILE = str(ROOT / "examples/nile.yaml"), str(ROOT / "data/nile.csv")
LANE_CHANGE = str(ROOT / "examples/severe_lane_change.yaml"), str(ROOT / "data/severe_lane_change.csv")
# An input of the pendulum that excites all of it.
TORQUE = "--input", "torque=1.5*sin(2*pi*0.4*t) + if(sin(0.9*t) > 0, 0.7, -0.7)"


def run(*arguments, code=None):
    done = subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, text=True, timeout=300)
    if code is not None:
        assert done.returncode == code, f"{arguments}: exit {done.returncode}\n{done.stdout}\n{done.stderr}"
    return done


def result(*arguments, code=0):
    out = json.loads(run(*arguments, "--json", code=code).stdout)
    jsonschema.validate(out, SCHEMA)
    assert out["status"]["exit"] == code
    return out


def shared(name):
    path = SHARED / name
    if not SHARED.exists():
        if os.environ.get("CI") == "true":
            raise AssertionError("the reference recordings are missing, and CI=true")
        raise unittest.SkipTest("no reference recordings beside the repository")
    return str(path)


class Folder:
    """A temporary folder that can write files into itself."""

    def __enter__(self):
        self._folder = tempfile.TemporaryDirectory()
        self.path = pathlib.Path(self._folder.name)
        return self

    def __exit__(self, *_):
        self._folder.cleanup()

    def write(self, name, content):
        target = self.path / name
        target.write_bytes(content if isinstance(content, bytes) else content.encode())
        return str(target)


SYSTEM_1 = """identikal: 1
name: System 1
time: {kind: discrete, step: 1 s}
A: [[0.5]]
C: [[1]]
Q: {structure: diagonal, start: 1}
R: {structure: diagonal, start: 1}
outputs: [{name: y, column: y}]
"""


VEHICLE = """identikal: 1
model: single-track
time: {column: t, unit: s}
parameters: {m: 1446 kg, a: 0.987 m, b: 1.525 m, steering_ratio: 21, Iz: {value: 2000 kg m^2, min: 800, max: 6000},
             Cf: {value: 8e4 N/rad, min: 1e4, max: 4e5}, Cr: {value: 8e4 N/rad, min: 1e4, max: 4e5}}
inputs: {steering_wheel_angle: {column: swa, unit: deg}, vx: {column: speed, unit: km/h}}
outputs: {r: {column: yaw_rate, unit: deg/s}, vy: {column: vy, unit: m/s}}
noise: {measurement: {kind: per-sample, sd: {r: 0.01 rad/s, vy: 0.03 m/s}}}
"""


def assert_same_rows(test, one, other):
    """Two ways to the same numbers, which differ by the rounding of their sums."""
    test.assertEqual(len(one), len(other))
    for a, b in zip(one, other):
        test.assertEqual([x is None for x in a], [x is None for x in b])
        test.assertTrue(all(x is None or abs(x - y) <= 1e-12 * (1 + abs(x)) for x, y in zip(a, b)), f"{a}\n{b}")


def table(text):
    rows = list(csv.reader(text.splitlines()))
    return rows[0], [[float(cell) if cell else None for cell in row] for row in rows[1:]]
