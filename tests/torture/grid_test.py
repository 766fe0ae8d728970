"""Every model with all data in every verb: grid_test.py PROGRAM [RUNS] [SEED]

Models that go with the data, and models that do not; data that nobody would want. Whatever comes is one of the documented
exit codes but 5, within ten seconds of the processor; a refusal is one line; a result is JSON without NaN, and its covariances are positive
semidefinite. Prints how often each code came, and each run that is wrong with its command."""
import collections
import concurrent.futures
import json
import math
import os
import pathlib
import random
import subprocess
import sys
import tempfile
import threading

PROGRAM = str(pathlib.Path(sys.argv[1]).resolve())
RUNS = int(sys.argv[2]) if len(sys.argv) > 2 else 300
SEED = int(sys.argv[3]) if len(sys.argv) > 3 else 1
LONGEST = 10.0  # s

HEAD = "identikal: 1\ntime: {kind: discrete, column: t, unit: s}\n"
QR = "parameters: {q: {value: 1, min: 0}, r: {value: 1, min: 0}}\n"
FORMULAS = "identikal: 1\ntime: {kind: continuous, column: t, unit: s}\nnoise: {process: density}\n"
MODELS = {
    "level": HEAD + QR + "outputs: {y: {}}\nA: [[1]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\ninitial: diffuse\n",
    "decay": HEAD + QR + "outputs: {y: {}}\nA: [[0.5]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\n",
    "unstable": HEAD + QR + "outputs: {y: {}}\nA: [[1.5]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\ninitial: diffuse\n",
    "free pole": HEAD + "outputs: {y: {}}\nparameters: {a: {value: 0.5, min: -0.999, max: 0.999}, q: {value: 1, min: 0}, r: {value: 1, min: 0}}\n"
                 "A: [[a]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\n",
    "tracker": HEAD + QR + "outputs: {y: {}}\nA: [[1, 1], [0, 1]]\nC: [[1, 0]]\nG: [[0.5], [1]]\nQ: [[q]]\nR: [[r]]\ninitial: diffuse\n",
    "unseen": HEAD + QR + "outputs: {y: {}}\nA: [[1, 0], [0, 1]]\nC: [[1, 0]]\nQ: [[q, 0], [0, q]]\nR: [[r]]\ninitial: diffuse\n",
    "exact": HEAD + "outputs: {y: {}}\nparameters: {q: {value: 1, min: 0}}\nA: [[1]]\nC: [[1]]\nQ: [[q]]\nR: [[0]]\ninitial: diffuse\n",
    "no noise": HEAD + "outputs: {y: {}}\nparameters: {r: {value: 1, min: 0}}\nA: [[0.9]]\nC: [[1]]\nQ: [[0]]\nR: [[r]]\ninitial: diffuse\n",
    "driven": HEAD + QR + "inputs: {u: {}}\noutputs: {y: {}}\nA: [[0.8]]\nB: [[1]]\nC: [[1]]\nQ: [[q]]\nR: [[r]]\n",
    "full": HEAD + "outputs: {y: {}, y2: {}}\nA: [[0.9, 0.1], [0, 0.7]]\nC: [[1, 0], [0, 1]]\nQ: {structure: full, start: 1}\nR: {structure: full, start: 1}\n",
    "season": HEAD + QR + "outputs: {y: {}}\ncomponents: {level: {kind: level, variance: {level: q}}, season: {kind: season, period: 4, variance: 1}}\n"
              "noise: {measurement: {variance: {y: r}}}\n",
    "arma": HEAD + "outputs: {y: {}}\nparameters: {q: {value: 1, min: 0}}\ncomponents: {a: {kind: arma, ar: 2, ma: 1, variance: q}}\n",
    "six": HEAD + QR + "outputs: {y: {}}\nA: " + str([[0.9 if i == j else 0.05 if j == i + 1 else 0 for j in range(6)] for i in range(6)]) +
           "\nC: [[1, 0, 0, 0, 0, 0]]\nG: [[1], [0], [0], [0], [0], [1]]\nQ: [[q]]\nR: [[r]]\n",
    "square": FORMULAS + "states: [x]\ndynamics: {x: -k*x + u}\ninputs: {u: {}}\noutputs: {y: {equals: x^2}}\n"
              "parameters: {k: {value: 1, min: 0, max: 50}}\nQ: [[0.1]]\nR: [[1]]\ninitial: {x: {mean: 1, sd: 1}}\n",
    "blows up": FORMULAS + "states: [x]\ndynamics: {x: k*x^2}\noutputs: {y: {equals: x}}\nparameters: {k: {value: 1, min: 0, max: 5}}\n"
                "Q: [[0.1]]\nR: [[1]]\ninitial: {x: {mean: 1, sd: 1}}\n",
    "stiff": FORMULAS + "states: [x, z]\ndynamics: {x: -1e6*(x - z), z: -k*z}\noutputs: {y: {equals: x}}\nparameters: {k: {value: 1, min: 0, max: 5}}\n"
             "Q: [[0, 0], [0, 0.1]]\nR: [[1]]\ninitial: {x: {mean: 1, sd: 1}, z: {mean: 1, sd: 1}}\n",
    "car": "identikal: 1\nmodel: single-track\ntime: {column: t, unit: s}\nparameters: {m: 1446 kg, a: 0.987 m, b: 1.525 m, steering_ratio: 21, "
           "Iz: {value: 2000 kg m^2, min: 800, max: 6000}, Cf: {value: 8e4 N/rad, min: 1e4, max: 4e5}, Cr: {value: 8e4 N/rad, min: 1e4, max: 4e5}}\n"
           "inputs: {steering_wheel_angle: {column: u, unit: deg}, vx: {column: v, unit: km/h}}\noutputs: {r: {column: y, unit: deg/s}}\n"
           "noise: {measurement: {kind: per-sample, sd: {r: 0.01 rad/s}}}\n",
    "regression": "identikal: 1\nmodel: regression\ntime: {column: t, unit: s}\noutputs: {y: {}}\ninputs: {u: {}}\nregression: {inputs: 1, feedback: 1, forgetting: 0.99, delta: 0.01}\n",
}
VERBS = {
    "tune": [[], ["--method", "als"], ["--method", "als-weighted"], ["--method", "bayes", "--draws", "50", "--time-limit", "5"], ["--reject-outliers"], ["--hold-out", "30%"],
             ["--extend"], ["--starts", "3"], ["--noise", "student"]],
    "fit": [[], ["--robust"], ["--objective", "simulation"], ["--method", "prediction-error"], ["--method", "trajectory"]],
    "check": [[]], "filter": [[], ["--smooth"], ["--lag", "3"]], "track": [[], ["--adaptive"], ["--particles", "20"]], "shape": [[], ["--order", "1"]],
    "bound": [["--rows", "20"]], "forecast": [["-n", "5"]], "info": [[], ["--vehicle"]], "simulate": [["-n", "20", "--seed", "1"]],
    "model": [["--output", "y"], ["--output", "y", "--input", "u", "--order", "2"]], "handling": [["--speed", "80"]],
}
WITHOUT_MODEL = {"info", "model"}
WITHOUT_DATA = {"bound", "simulate", "handling"}
NO_JSON = {"simulate"}


def base(count, seed=5):
    source = random.Random(seed)
    t, level, out = 0.0, 0.0, {"t": [], "u": [], "v": [], "y": [], "y2": []}
    for k in range(count):
        u = 40 * math.sin(k / 6)
        level = 0.8 * level + u / 40 + source.gauss(0, 1)
        for name, value in zip(out, (t, u, 80.0, level + source.gauss(0, 1), 0.5 * level + source.gauss(0, 1))):
            out[name].append(value)
        t += 0.05
    return out


def with_values(columns, change):
    return {name: [change(k, x) for k, x in enumerate(values)] if name in ("y", "y2") else values for name, values in columns.items()}


def data_kinds():
    plain = base(150)
    nan = float("nan")
    kinds = {
        "plain": plain, "one row": base(1), "two rows": base(2), "three rows": base(3), "ten rows": base(10), "long": base(5000),
        "zeros": with_values(plain, lambda k, x: 0.0), "constant": with_values(plain, lambda k, x: 7.25),
        "all missing": with_values(plain, lambda k, x: nan), "half missing": with_values(plain, lambda k, x: nan if k % 2 else x),
        "one measured": with_values(plain, lambda k, x: x if k == 50 else nan), "begins late": with_values(plain, lambda k, x: x if k > 120 else nan),
        "huge": with_values(plain, lambda k, x: x * 1e140), "tiny": with_values(plain, lambda k, x: x * 1e-140), "large": with_values(plain, lambda k, x: x * 1e60),
        "outlier": with_values(plain, lambda k, x: 1e12 if k == 70 else x), "offset": with_values(plain, lambda k, x: x + 1e9),
        "ramp": with_values(plain, lambda k, x: 3.0 * k), "powers": with_values(plain, lambda k, x: 1.5 ** k), "step": with_values(plain, lambda k, x: float(k > 75)),
        "spike": with_values(plain, lambda k, x: float(k == 75)), "alternating": with_values(plain, lambda k, x: (-1.0) ** k),
        "quantised": with_values(plain, lambda k, x: round(x)), "sine": with_values(plain, lambda k, x: math.sin(0.3 * k)),
    }
    held = dict(plain, t=[0.0] * 150)
    kinds.update({"no time": {n: v for n, v in plain.items() if n != "t"}, "same time": held,
                  "backwards": dict(plain, t=plain["t"][::-1]), "a gap": dict(plain, t=[t + 100.0 * (k > 75) for k, t in enumerate(plain["t"])]),
                  "jitter": dict(plain, t=[t + 0.01 * math.sin(k * k) for k, t in enumerate(plain["t"])]),
                  "far in time": dict(plain, t=[t + 1e9 for t in plain["t"]]), "slow time": dict(plain, t=[t * 1e6 for t in plain["t"]]),
                  "no input": dict(plain, u=[0.0] * 150), "missing input": dict(plain, u=[nan] * 150), "standing": dict(plain, v=[0.0] * 150)})
    out = {name: text_of(columns) for name, columns in kinds.items()}
    lines = out["plain"].splitlines()
    out.update({"text": "\n".join(lines[:50] + ["a,b,c,d,e"] + lines[50:]) + "\n", "empty": "", "header alone": lines[0] + "\n", "cut short": out["plain"][:-9],
                "infinite": out["plain"].replace(lines[60], "3.0,0,80,inf,-inf"), "bytes": "\x00\xff\x80" * 100, "other columns": "a,b\n1,2\n3,4\n"})
    return out


def text_of(columns):
    rows = zip(*columns.values())
    return ",".join(columns) + "\n" + "".join(",".join("" if math.isnan(x) else repr(x) for x in row) + "\n" for row in rows)


def indefinite(name, matrix):
    """Rows and columns by their own size, a billionth more on the diagonal: is there a Cholesky factor?"""
    n = len(matrix)
    if any(x is None for row in matrix for x in row):
        return ""
    size = [math.sqrt(abs(matrix[i][i])) or math.sqrt(max(map(abs, matrix[i]))) or 1.0 for i in range(n)]
    L = [[0.0] * n for _ in range(n)]
    for i in range(n):
        for j in range(i + 1):
            left = matrix[i][j] / size[i] / size[j] + (1e-9 if i == j else 0.0) - sum(a * b for a, b in zip(L[i][:j], L[j][:j]))
            if i == j and left < 0.0:
                return f"{name} is not positive semidefinite"
            L[i][j] = math.sqrt(left) if i == j else left / L[j][j] if L[j][j] > 0.0 else 0.0
    return ""


def covariances(node, path=""):
    """Every Q, R, P of a result."""
    if isinstance(node, dict):
        for key, value in node.items():
            if key in ("Q", "R", "P") or path.endswith(("Q", "R")) and key == "matrix":
                matrix = value.get("matrix") if isinstance(value, dict) else value
                if isinstance(matrix, list) and matrix and isinstance(matrix[0], list) and len(matrix) == len(matrix[0]):
                    yield f"{path}.{key}", matrix
            yield from covariances(value, f"{path}.{key}")


def refuse(text):
    raise ValueError(f"{text} in JSON")


def wrong(done, seconds, asks_json):
    said = done.stderr.decode(errors="replace")
    if not 0 <= done.returncode <= 4:
        return f"exit {done.returncode}: {said[-300:]}"
    if seconds > LONGEST:
        return f"{seconds:.1f} s"
    if done.returncode == 2:
        good = said.startswith("identikal: ") and said.count("\n") == 1 and "internal" not in said
        return "" if good else f"not one line: {said!r}"
    if not asks_json:
        return ""
    try:
        result = json.loads(done.stdout, parse_constant=refuse)
    except ValueError as error:
        return str(error)
    return next(filter(None, (indefinite(*each) for each in covariances(result))), "")


def measured(command, folder):
    """What it did, and the processor time that it took [s]: others work here too."""
    with tempfile.TemporaryFile() as out, tempfile.TemporaryFile() as said:
        job = subprocess.Popen(command, cwd=folder, stdout=out, stderr=said)
        end = threading.Timer(60, job.kill)
        end.start()
        _, status, usage = os.wait4(job.pid, 0)
        end.cancel()
        job.returncode = os.waitstatus_to_exitcode(status)
        out.seek(0), said.seek(0)
        return subprocess.CompletedProcess(command, job.returncode, out.read(), said.read()), usage.ru_utime + usage.ru_stime


def main():
    kinds = data_kinds()
    with tempfile.TemporaryDirectory() as folder:
        folder = pathlib.Path(folder)
        for k, text in enumerate(MODELS.values()):
            (folder / f"m{k}.yaml").write_text(text)
        for k, text in enumerate(kinds.values()):
            (folder / f"d{k}.csv").write_bytes(text.encode("latin-1"))
        runs = [(m, d, verb, options) for verb, variants in VERBS.items() for options in variants
                for m in (range(len(MODELS)) if verb not in WITHOUT_MODEL else [None])
                for d in (range(len(kinds)) if verb not in WITHOUT_DATA else [None])]
        random.Random(SEED).shuffle(runs)
        chosen = runs[:RUNS]

        def run(each):
            m, d, verb, options = each
            words = [verb] + ([f"m{m}.yaml"] if m is not None else []) + ([f"d{d}.csv"] if d is not None else []) + options
            asks_json = verb not in NO_JSON
            done, seconds = measured([PROGRAM, *words, *(["--json"] if asks_json else [])], folder)
            return words, each, done.returncode, wrong(done, seconds, asks_json), seconds

        codes, bad, slowest = collections.Counter(), [], 0.0
        with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as workers:
            for words, (m, d, verb, _), code, why, seconds in workers.map(run, chosen):
                codes[code] += 1
                slowest = max(slowest, seconds)
                if why:
                    bad.append((words, list(MODELS)[m] if m is not None else "-", list(kinds)[d] if d is not None else "-", why))
    print(f"{len(chosen)} of {len(runs)} runs; exit codes", dict(sorted(codes.items(), key=str)), f"; slowest {slowest:.1f} s; wrong: {len(bad)}")
    for words, model, data, why in bad[:60]:
        print(f"  {' '.join(words)}  ({model}; {data}): {why[:300]}")
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
