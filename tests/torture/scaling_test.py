"""Data times 10^k: variances times 10^2k, and nothing else changes. scaling_test.py PROGRAM

Either the estimates of Q and R are those of the data as they were times 10^2k, to 1e-9 of themselves, with the same status, or
the data are refused. By least squares on autocovariances the model file stays as it is; by likelihood its starts are in the
unit of the data. Prints the largest difference."""
import json
import pathlib
import subprocess
import sys
import tempfile

from grid_test import base

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
HEAD = "identikal: 1\ntime: {kind: discrete, step: 1 s}\n"
POWERS = [-100, -60, -30, -12, -6, -3, 3, 6, 12, 30, 60, 100]


def models(start):
    noise = f"Q: {{structure: diagonal, start: {start!r}}}\nR: {{structure: diagonal, start: {start!r}}}\n"
    full = f"Q: {{structure: full, start: {start!r}}}\nR: {{structure: full, start: {start!r}}}\n"
    return {"decay": HEAD + "outputs: {y: {}}\nA: [[0.5]]\nC: [[1]]\n" + noise,
            "level": HEAD + "outputs: {y: {}}\nA: [[1]]\nC: [[1]]\ninitial: diffuse\n" + noise,
            "tracker": HEAD + "outputs: {y: {}}\nA: [[1, 1], [0, 1]]\nC: [[1, 0]]\nG: [[0.5], [1]]\ninitial: diffuse\n" + noise,
            "full": HEAD + "outputs: {y: {}, y2: {}}\nA: [[0.9, 0.1], [0, 0.7]]\nC: [[1, 0], [0, 1]]\n" + full}


def tuned(folder, model, columns, method):
    (folder / "m.yaml").write_text(model)
    (folder / "d.csv").write_text("y,y2\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(*columns)))
    done = subprocess.run([PROGRAM, "tune", "m.yaml", "d.csv", "--method", method, "--json"], cwd=folder, capture_output=True, text=True)
    if done.returncode == 2:
        assert done.stderr.count("\n") == 1, done.stderr
        return None
    out = json.loads(done.stdout)
    return out["status"]["code"], [x for name in "QR" for row in out["noise"][name]["matrix"] for x in row]


def main():
    data = base(400)
    columns = [data["y"], data["y2"]]
    worst, refused, failed = 0.0, 0, []
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for name in models(1.0):
            for method in ("als", "als-weighted", "ml"):
                status, values = tuned(folder, models(1.0)[name], columns, method)
                largest = max(map(abs, values))
                for k in POWERS:
                    unit = float(f"1e{2 * k}")
                    scaled = tuned(folder, models(unit if method == "ml" else 1.0)[name], [[x * 10.0 ** k for x in c] for c in columns], method)
                    if scaled is None:
                        refused += 1
                        continue
                    away = max(abs(a / unit - b) for a, b in zip(scaled[1], values)) / largest
                    worst = max(worst, away)
                    if away > 1e-9 or scaled[0] != status:
                        failed.append(f"{name} {method} 10^{k}: {away:.1e}, {scaled[0]} for {status}")
    print(f"{len(models(1.0)) * 3 * len(POWERS)} runs, {refused} refused, largest difference {worst:.1e}; wrong: {len(failed)}")
    for text in failed[:40]:
        print("  " + text)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
