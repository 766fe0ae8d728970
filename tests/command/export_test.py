"""export: code to paste."""
import hashlib
import json
import math
import os
import pathlib
import random
import shutil
import subprocess
import sys
import unittest

from program import LANE_CHANGE, NILE, TORQUE, Folder, result, run, table


def interpreter_with_numpy():
    for python in (sys.executable, "/usr/bin/python3"):
        try:
            if subprocess.run([python, "-c", "import numpy"], capture_output=True).returncode == 0:
                return python
        except OSError:
            pass
    return None


def compiled(folder, source, name, compiler, standard):
    """What a program that includes nothing but the export and stdio prints; no warning allowed."""
    path = folder.write(name, source)
    program = folder.path / "program"
    done = subprocess.run([compiler, standard, "-Wall", "-Wextra", "-pedantic", "-Werror", path, "-o", program, "-lm"],
                          capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return [float(v) for v in subprocess.run([program], capture_output=True, text=True, check=True).stdout.split()]


def flat(matrix):
    return [v for row in matrix for v in row]


class Export(unittest.TestCase):
    """The text is compiled or run, and gives the numbers of result.json to the last digit."""

    def setUp(self):
        self.folder = Folder().__enter__()
        self.out = self.folder.path / "out"

    def tearDown(self):
        self.folder.__exit__()

    def exported(self, language, *extra):
        return run("export", self.out, "--to", language, *extra, code=0).stdout

    def stored(self):
        return json.loads((self.out / "result.json").read_text())

    def matrices(self):
        f = self.stored()["filter"]
        names = {"K_predictor": "K", "L_filter": "L"}
        return {n: f[names.get(n, n)] for n in ("A", "B", "C", "D", "G", "Q", "R", "S", "K_predictor", "L_filter", "P", "Sigma")
                if f[names.get(n, n)] and f[names.get(n, n)][0]}

    def filter_in_every_language(self, name):
        expected = self.matrices()
        values = [v for M in expected.values() for v in flat(M)] + [self.stored()["filter"]["dt"]]
        prints = "".join(f"for (i = 0; i < {len(flat(M))}; ++i) printf(\"%.17g\\n\", (&{{0}}{n}[0][0])[i]);\n" for n, M in expected.items())
        prints += "printf(\"%.17g\\n\", {0}dt);\n"
        for language, suffix, compiler, standard, prefix in (("c", "c", "gcc", "-std=c99", f"{name}_"), ("cpp", "cpp", "g++", "-std=c++17", f"{name}::")):
            header = f"export.{language}.h"
            run("export", self.out / "result.json", "--to", language, "-o", self.folder.path / header, code=0)
            source = f"#include \"{header}\"\n#include <stdio.h>\nint main(void) {{\nint i;\n" + prints.format(prefix) + "return 0;\n}\n"
            self.assertEqual(values, compiled(self.folder, source, f"main.{suffix}", compiler, standard), language)
        text = self.exported("matlab")
        for n, M in expected.items():
            row = next(line for line in text.splitlines() if line.startswith(n + " = "))
            body = row.split("[", 1)[1].split("]", 1)[0]
            self.assertEqual(M, [[float(v) for v in r.split(",")] for r in body.split(";")])
        numbers = json.loads(self.exported("json"))
        self.assertEqual(expected, {n: numbers[n] for n in expected})
        python, octave = interpreter_with_numpy(), shutil.which("octave")
        if octave:
            show = "".join(f"M = {n}'; printf('%.17g\\n', M(:));" for n in expected)
            script = self.folder.write("script.m", text + show + "printf('%.17g\\n', dt);\n")
            printed = subprocess.run([octave, "--no-gui", "--quiet", script], capture_output=True, text=True, check=True).stdout
            self.assertEqual(values, [float(v) for v in printed.split()])
        if python:
            show = "".join(f"print(*[repr(float(v)) for v in {n}.ravel()])\nassert {n}.shape == {(len(M), len(M[0]))}\n" for n, M in expected.items())
            done = subprocess.run([python, "-c", self.exported("python") + show + "print(dt)\n"], capture_output=True, text=True, check=True)
            self.assertEqual(values, [float(v) for v in done.stdout.split()])
        elif os.environ.get("CI") == "true":
            raise AssertionError("numpy is missing, and CI=true")

    def test_a_filter(self):
        out = result("tune", *NILE, "-o", self.out)
        self.filter_in_every_language("nile_filter")
        f = out["filter"]
        P, R, K = f["P"][0][0], out["noise"]["R"]["matrix"][0][0], out["noise"]["K_steady"]
        self.assertEqual([K, out["noise"]["P_steady"]], [f["K"], f["P"]])
        self.assertAlmostEqual(P / (P + R), f["L"][0][0], delta=1e-12)
        text = self.exported("python")
        for words in ("# status ok", "data/nile.csv, 100 of 100 rows used, sha256 ", "nile.yaml, sha256 ", "command: identikal tune",
                      "q = 1469.18, se 1.28e+03, poorly determined", "r = 15098.5, se 3.15e+03, ok", "K = (A P C' + G S) Sigma^-1",
                      "L = P C' Sigma^-1", "per sample", "version 0.1.0"):
            self.assertIn(words, text)
        # The estimates, pasted as a model file, are where the search ends at once.
        model = self.folder.write("pasted.yaml", self.exported("yaml"))
        text = pathlib.Path(NILE[0]).read_text()
        self.assertIn("min: 0, role: process-noise", pathlib.Path(model).read_text())
        again = result("tune", model, NILE[1], "--starts", 1)
        self.assertAlmostEqual(again["objective"]["log_likelihood_start"], out["objective"]["log_likelihood"], delta=1e-9)
        checked = result("check", model, NILE[1])
        self.assertEqual([p["value"] for p in out["parameters"]], [p["value"] for p in checked["parameters"]])

    def test_matrices_with_inputs_in_continuous_time(self):
        """Blocks of Q and R, a density, an input between samples, names that are no identifiers."""
        model = self.folder.write("m.yaml", """identikal: 1
name: "7 \u00dcber-levels ??/"
time: {kind: continuous, step: 0.1 s, inputs: foh}
parameters:
  k: {value: -0.8, min: -5, max: 0}
A: [[0, 1], [-2, k]]
B: [[0], [1]]
C: [[1, 0]]
G: [[0], [1]]
Q:
  structure: full
  start:
    - [0.5]
R: {structure: diagonal, start: [0.02]}
noise: {process: density}
inputs: [{name: u, column: u}]
outputs: [{name: y, column: y, unit: mm}]
""")
        random.seed(3)
        u = self.folder.write("u.csv", "u\n" + "".join(f"{random.gauss(0, 1):.4f}\n" for _ in range(800)))
        run("simulate", model, u, "--seed", 4, "-o", self.folder.path, code=0)
        done = run("fit", model, self.folder.path / "simulated.csv", "-o", self.out)
        self.assertIn(done.returncode, (0, 1), done.stderr)
        self.assertEqual((1, 2), (len(self.stored()["filter"]["C"]), len(self.stored()["filter"]["B"][0])))
        self.filter_in_every_language("model_7_ber_levels_filter")
        self.assertIn("Q_density = np.array([[", self.exported("python"))
        self.assertIn("recorded in mm", self.exported("python"))
        pasted = self.folder.write("pasted.yaml", self.exported("yaml"))
        checked = json.loads(run("check", pasted, self.folder.path / "simulated.csv", "--json").stdout)
        self.assertEqual([p["value"] for p in self.stored()["parameters"]], [p["value"] for p in checked["parameters"]])
        self.assertAlmostEqual(checked["objective"]["log_likelihood"], self.stored()["objective"]["log_likelihood"], delta=1e-6)

    def test_a_vehicle(self):
        out = result("fit", *LANE_CHANGE, "-o", self.out)
        parameters = {p["name"]: p["value"] for p in out["parameters"]}
        self.assertEqual("linear", out["tyre_curve"])
        for language, compiler, standard, name in (("c", "gcc", "-std=c99", "severe_lane_change_car_estimate"),
                                                   ("cpp", "g++", "-std=c++17", "severe_lane_change_car::estimate")):
            header = self.folder.write("car.h", self.exported(language))
            self.assertIn("double Cf;  // N/rad", pathlib.Path(header).read_text())
            source = '#include "car.h"\n#include <stdio.h>\nint main(void) {\n' + "".join(
                f'printf("%.17g\\n", {name}.{n});\n' for n in parameters) + "return 0;\n}\n"
            self.assertEqual(list(parameters.values()), compiled(self.folder, source, f"main.{language}", compiler, standard))
        space = {}
        exec(self.exported("python"), space)
        self.assertEqual(parameters, space["car"])
        for n, v in parameters.items():
            line = next(row for row in self.exported("matlab").splitlines() if row.startswith(f"car.{n} = "))
            self.assertEqual(v, float(line.split(" = ")[1].split(";")[0]))
        self.assertIn("# SERIOUS" if out["status"]["code"] != "ok" else "# status ok", self.exported("python"))
        pasted = self.folder.write("pasted.yaml", self.exported("yaml"))
        text = pathlib.Path(pasted).read_text()
        self.assertIn("# never estimated", text)
        self.assertIn(f"Cf: {{value: {parameters['Cf']!r} N/rad, min: 1e4, max: 4e5}}", text)
        again = result("fit", pasted, LANE_CHANGE[1])
        self.assertEqual(parameters, {p["name"]: p["start"] for p in again["parameters"]})
        self.assertAlmostEqual(again["objective"]["log_likelihood"], out["objective"]["log_likelihood"], delta=1e-6)

    def test_formulas_with_an_offset(self):
        """v' = u - k v + 3, u between samples: the constant has a column of B of its own, now and at the next sample."""
        model = self.folder.write("m.yaml", """identikal: 1
time: {kind: continuous, step: 0.1 s, inputs: foh}
parameters:
  k: {value: 0.8 1/s, min: 0.01}
  c: 3 m/s^2
states: {v: m/s}
inputs: {u: {column: u, unit: m/s^2}}
dynamics: {v: u - k*v + c}
outputs: {y: {column: y, unit: km/h, equals: v}}
noise: {process: {kind: density, sd: {v: 0.1}}, measurement: {sd: {y: 0.5}}}
initial: stationary
""")
        random.seed(5)
        u = self.folder.write("u.csv", "u\n" + "".join(f"{random.gauss(0, 1):.4f}\n" for _ in range(400)))
        run("simulate", model, u, "--seed", 4, "-o", self.folder.path, code=0)
        data = self.folder.path / "simulated.csv"
        run("fit", model, data, "-o", self.out, code=0)
        stored = self.stored()
        f, k = stored["filter"], stored["parameters"][0]["value"]
        self.assertEqual([("u", "m/s^2"), ("1", ""), ("u of the next sample", "m/s^2"), ("1", "")], [(c["name"], c["unit"]) for c in f["inputs"]])
        B, decay = f["B"][0], math.exp(-0.1 * k)
        self.assertAlmostEqual(B[1] + B[3], 3 * (1 - decay) / k, delta=1e-12)
        self.assertAlmostEqual(B[2], (0.1 - (1 - decay) / k) / k / 0.1, delta=1e-12)
        for now in (0, 2):
            self.assertAlmostEqual(3 * B[now], B[now + 1], delta=1e-14)
        self.assertIn("u (recorded in m/s^2), 1, u of the next sample", self.exported("python"))
        head, _ = table(run("filter", model, data, "--from", self.out, code=0).stdout)
        self.assertEqual(["time [s]", "v [m/s]", "v_sd [m/s]"], head)
        pasted = self.folder.write("pasted.yaml", self.exported("yaml"))
        self.assertEqual(k, result("check", pasted, data)["parameters"][0]["value"])
        own = result("validate", self.out, data)
        self.assertEqual(stored["objective"]["log_likelihood"], own["objective"]["log_likelihood"])

    def test_formulas_that_are_not_linear(self):
        """Parameters, noise and start; a parameter may be called as a word of a language, and be given in centimetres."""
        model = self.folder.write("m.yaml", run("init", "pendulum", code=0).stdout.replace("l: {value: 0.8 m, min: 0.1, max: 5}", "long: {value: 80 cm, min: 10, max: 500}")
                                  .replace("g/l*", "g/long*").replace("m*l^2", "m*long^2"))
        run("simulate", model, "-n", 300, *TORQUE, "-o", self.folder.path, code=0)
        data = self.folder.path / "simulated.csv"
        run("fit", model, data, "--starts", 1, "-o", self.out, code=0)
        stored = self.stored()
        expected = {p["name"]: p["value"] for p in stored["parameters"]}
        expected["long"] /= 100
        values, q, r = list(expected.values()), expected["q"], expected["r"]
        prints = "".join(f'printf("%.17g\\n", {{0}}estimate.{"long_" if n == "long" else n});\n' for n in expected)
        prints += 'printf("%.17g %.17g %.17g %.17g\\n", {0}Q[1][1], {0}R[0][0], {0}x0[0][0], {0}P0[1][1]);\n'
        for language, compiler, standard, prefix in (("c", "gcc", "-std=c99", "pendulum_model_"), ("cpp", "g++", "-std=c++17", "pendulum_model::")):
            self.folder.write("model.h", self.exported(language))
            source = '#include "model.h"\n#include <stdio.h>\nint main(void) {\n' + prints.format(prefix) + "return 0;\n}\n"
            for a, b in zip([*values, q, r, math.radians(20), 0.04], compiled(self.folder, source, f"main.{language}", compiler, standard)):
                self.assertAlmostEqual(a, b, delta=1e-15 * abs(a))
        matlab = self.exported("matlab")
        self.assertIn(f"p.q = {q!r};  % s^-3, se", matlab.replace("1/s^3", "s^-3"))
        self.assertRegex(matlab, r"p\.long_ = [0-9.]+;  % m, se .* cm")
        self.assertIn("% states x: phi (rad), w (rad/s)", matlab)
        numbers = json.loads(self.exported("json"))
        self.assertEqual(("density", [[0, 0], [0, q]], [[r]]), (numbers["Q_kind"], numbers["Q"], numbers["R"]))
        self.assertEqual(["phi", "w"], [s["name"] for s in numbers["states"]])
        self.assertEqual(list(expected), list(numbers["parameters"]))
        again = result("check", self.folder.write("pasted.yaml", self.exported("yaml")), data)
        self.assertEqual([p["value"] for p in stored["parameters"]], [p["value"] for p in again["parameters"]])
        self.assertAlmostEqual(again["objective"]["log_likelihood"], stored["objective"]["log_likelihood"], delta=1e-5)
        run("report", self.out, code=0)
        page = (self.out / "report.html").read_text()
        self.assertEqual(5, len(json.loads(page.split('id="paste">')[1].split("</script>")[0])))
        python = interpreter_with_numpy()
        if python:
            show = "print(repr([*p.values(), float(Q[1, 1]), float(R[0, 0])]))"
            done = subprocess.run([python, "-c", self.exported("python") + show], capture_output=True, text=True, check=True)
            for a, b in zip([*values, q, r], json.loads(done.stdout)):
                self.assertAlmostEqual(a, b, delta=1e-15 * abs(a))

    def test_a_model_that_includes_another(self):
        text = pathlib.Path(NILE[0]).read_text()
        level = "  r: {value: 1000, min: 0, role: measurement-noise}\n"
        self.assertIn(level, text)
        common = self.folder.write("common.yaml", "parameters:\n" + level)
        model = self.folder.write("m.yaml", "include: common.yaml\n" + text.replace(level, ""))
        run("tune", model, NILE[1], "-o", self.out, code=0)
        included = self.stored()["model_file"]["included"]
        self.assertEqual([(str(common), hashlib.sha256(pathlib.Path(common).read_bytes()).hexdigest())], [(f["path"], f["sha256"]) for f in included])
        held = result("validate", self.out, NILE[1])
        self.assertEqual(self.stored()["objective"]["log_likelihood"], held["objective"]["log_likelihood"])
        self.assertIn("none in an included one", run("export", self.out, "--to", "yaml", code=2).stderr)
        self.folder.write("common.yaml", "parameters:\n" + level + "  s: 1\n")
        self.assertIn("common.yaml, which its model file includes, has changed", run("validate", self.out, NILE[1], code=2).stderr)
        pathlib.Path(common).unlink()
        for verb in (("validate", self.out, NILE[1]), ("export", self.out, "--to", "yaml")):
            self.assertIn("common.yaml, which its model file includes, is no longer there", run(*verb, code=2).stderr)
        self.assertIn("K_predictor", self.exported("matlab"))
        run("report", self.out, code=0)

    def test_units_and_a_straight_axle(self):
        text = pathlib.Path(LANE_CHANGE[0]).read_text()
        model = self.folder.write("m.yaml", text.replace("curve: linear", "curve: tanh").replace(
            "  Iz:", "  bias_r: {value: 0.1 deg/s, min: -3, max: 3}\n  Iz:"))
        run("fit", model, LANE_CHANGE[1], "-o", self.out)
        stored = {p["name"]: p for p in self.stored()["parameters"]}
        space = {}
        exec(self.exported("python"), space)
        self.assertAlmostEqual(space["car"]["bias_r"], stored["bias_r"]["value"] * 3.14159265358979323846 / 180, delta=1e-17)
        for name in ("Ff_max", "Fr_max"):
            self.assertEqual(stored[name]["value"], space["car"].get(name))
        self.straight_axle("Fr_max", stored)

    def straight_axle(self, name, stored):
        """No Inf tanh(0), which is no number: the axle has no largest force, and the text says F = L."""
        text = (self.out / "result.json").read_text()
        result = json.loads(text)
        p = next(p for p in result["parameters"] if p["name"] == name)
        p["value"], p["verdict"], p["se"] = None, "at_bound", None
        (self.out / "report_data.json").unlink()
        (self.out / "result.json").write_text(json.dumps(result))
        for language in ("cpp", "c", "matlab", "python", "json"):
            export = self.exported(language)
            self.assertNotRegex(export, r"(?i)\b(inf|infinity|nan|null)\b" if language != "json" else "Infinity|NaN")
            if language == "json":
                self.assertIn("rear", json.loads(export)["straight_axles"])
                self.assertNotIn(name, json.loads(export)["parameters"])
            else:
                self.assertIn(f"F = L for the rear axle, so there is no {name}", export)
                self.assertNotIn(f"// {name} [", export)
                self.assertNotRegex(export, f"(double |car\\.|\"){name}")
        (self.out / "result.json").write_text(text)

    def test_pasted_units(self):
        text = pathlib.Path(LANE_CHANGE[0]).read_text()
        model = self.folder.write("m.yaml", text.replace("curve: linear", "curve: tanh").replace(
            "  Iz:", "  bias_r: {value: 0.1 deg/s, min: -3, max: 3}\n  Iz:"))
        run("fit", model, LANE_CHANGE[1], "-o", self.out)
        numbers = json.loads(self.exported("json"))
        space = {}
        exec(self.exported("python"), space)
        self.assertEqual(space["car"], {n: p["value"] for n, p in numbers["parameters"].items()})
        self.assertEqual({"Cf": "N/rad", "Iz": "kg m^2", "bias_r": "rad/s"}, {n: numbers["parameters"][n]["unit"] for n in ("Cf", "Iz", "bias_r")})
        stored = {p["name"]: p for p in self.stored()["parameters"]}
        self.assertAlmostEqual(stored["bias_r"]["se"] * math.pi / 180, numbers["parameters"]["bias_r"]["se"], delta=1e-15)
        header = self.folder.write("car.h", self.exported("c"))
        compiled(self.folder, f'#include "{header}"\nint main(void) {{ return severe_lane_change_car_estimate.m > 0 ? 0 : 1; }}\n', "main.c", "gcc", "-std=c99")
        pasted = self.folder.write("pasted.yaml", self.exported("yaml"))
        self.assertIn("deg/s", pathlib.Path(pasted).read_text())
        self.assertIn(run("fit", pasted, LANE_CHANGE[1]).returncode, (0, 1))
        out = json.loads(run("validate", self.out, LANE_CHANGE[1], "--json").stdout)
        for channel, fit in self.stored()["fit"]["simulation"].items():
            self.assertAlmostEqual(fit["fit_percent"], out["fit"]["simulation"][channel]["fit_percent"], delta=0.01)

    def test_doubts_are_said(self):
        run("check", *NILE, "--set", "r=1000", "-o", self.out, code=1)
        text = self.exported("c")
        self.assertIn("// REJECTED: not optimal", text)
        self.assertIn("r = 1000, known", text)
        self.assertIn("r: {value: 1000.0" if "1000.0" in self.exported("yaml") else "r: {value: 1000", self.exported("yaml"))
        data = self.folder.write("white.csv", "volume\n" + "".join(f"{random.Random(i).gauss(0, 1):.5f}\n" for i in range(200)))
        run("tune", NILE[0], data, "-o", self.out)
        stored = self.stored()
        self.assertEqual("at_bound", stored["parameters"][0]["verdict"])
        self.assertIn("AT ITS BOUND", self.exported("python"))
        pasted = self.folder.write("pasted.yaml", self.exported("yaml"))
        self.assertEqual(0, json.loads(run("check", pasted, data, "--json").stdout)["parameters"][0]["value"])

    def test_a_sensor_without_noise_is_no_silent_export(self):
        """Noise that integrates twice, taken for a level: nothing is left for the sensor."""
        chance = random.Random(1)
        lines, level, slope = ["year,volume"], 0.0, 0.0
        for k in range(300):
            slope = 0.7 * slope + chance.gauss(0, 1)
            level += slope
            lines.append(f"{k},{level}")
        data = self.folder.write("smooth.csv", "\n".join(lines) + "\n")
        run("tune", NILE[0], data, "-o", self.out, code=1)
        stored = self.stored()
        self.assertEqual(0, stored["parameters"][1]["value"])
        self.assertIn("no_measurement_noise", [w["code"] for w in stored["warnings"]])
        self.assertIn("--force exports it all the same", run("export", self.out, "--to", "c", code=2).stderr)
        for format in ("cpp", "c", "matlab", "python", "yaml"):
            self.assertIn("SERIOUS: the measurement noise of 'level' was estimated as zero (r = 0)", self.exported(format, "--force"))

    def test_a_covariance_that_held_out_rows_contradict(self):
        """The second recording has noise of three times the variance, and the same gain."""
        def level(name, size, seed):
            chance, x, lines = random.Random(seed), 0.0, ["volume"]
            for _ in range(2000):
                x += size * chance.gauss(0, 1)
                lines.append(f"{x + 2 * size * chance.gauss(0, 1):.6f}")
            return self.folder.write(name, "\n".join(lines) + "\n")
        fitted, larger = level("fitted.csv", 1.0, 1), level("larger.csv", math.sqrt(3.0), 2)
        run("tune", NILE[0], fitted, "-o", self.out)
        self.assertNotIn("covariance_factor", self.exported("json"))
        out = result("tune", NILE[0], fitted, "--hold-out", larger, "-o", self.out)
        factor, = [d["value"] for d in out["derived"] if d["name"] == "covariance factor by held-out rows"]
        self.assertAlmostEqual(3.0, factor, delta=0.3)  # 3.2 standard deviations of a ratio of two variances
        self.assertEqual(factor, json.loads(self.exported("json"))["covariance_factor"])
        for language, line in (("cpp", "inline constexpr double covariance_factor = "), ("c", "static const double nile_filter_covariance_factor = "),
                               ("matlab", "covariance_factor = "), ("python", "covariance_factor = ")):
            text = self.exported(language)
            self.assertIn(line + str(factor)[:6], text)
            self.assertIn("on held-out rows the innovations are 1.7", text)

    def test_json_says_where_it_comes_from(self):
        data = self.folder.write("white.csv", "volume\n" + "".join(f"{random.Random(i).gauss(0, 1):.5f}\n" for i in range(200)))
        run("tune", NILE[0], data, "-o", self.out)
        numbers, stored = json.loads(self.exported("json")), self.stored()
        self.assertEqual({k: stored["status"][k] for k in ("code", "message")}, numbers["status"])
        self.assertEqual([w["text"] for w in stored["warnings"]], [w["text"] for w in numbers["warnings"]])
        self.assertGreater(len(numbers["warnings"]), 0)
        self.assertEqual(stored["version"], numbers["version"])
        self.assertEqual(stored["model_file"]["sha256"], numbers["model_file"]["sha256"])
        self.assertEqual([i["sha256"] for i in stored["inputs"]], [d["sha256"] for d in numbers["data"]])
        self.assertEqual(hashlib.sha256(pathlib.Path(data).read_bytes()).hexdigest(), numbers["data"][0]["sha256"])
        self.assertIn("identikal tune", numbers["command"])
        self.assertEqual({"name": "volume", "recorded_in": stored["filter"]["outputs"][0]["unit"]}, {**numbers["outputs"][0], "name": "volume"})

    def test_the_page_has_the_same(self):
        run("tune", *NILE, "-o", self.out, "--report", self.folder.path / "page.html", code=0)
        page = (self.folder.path / "page.html").read_text()
        paste = {b["language"]: b["text"] for b in json.loads(page.split('id="paste">')[1].split("</script>")[0])}
        self.assertEqual(5, len(paste))
        undated = self.exported("python").replace(", result written " + self.exported("python").split("result written ")[1][:10], "")
        self.assertEqual(undated, paste["Python"])

    def test_no_words_of_others_become_code(self):
        evil = 'x")\nimport os; os.system("evil")\n#'
        with Folder() as folder:
            out = folder.path / "out"
            run("fit", *LANE_CHANGE, "-o", out)
            text = (out / "result.json").read_text()
            for change in (lambda d: d.update(tyre_curve=evil), lambda d: d["parameters"][0].update(name=evil),
                           lambda d: d["parameters"][0].update(name="m; system(1)"), lambda d: d["parameters"][1].update(unit=evil),
                           lambda d: d["parameters"][1].update({"with": [evil]})):
                spoilt = json.loads(text)
                change(spoilt)
                alone = folder.write("spoilt.json", json.dumps(spoilt))
                for language in ("python", "c", "cpp", "matlab", "json", "yaml"):
                    done = run("export", alone, "--to", language, code=2)
                    self.assertEqual("", done.stdout)
                    self.assertEqual(1, done.stderr.count("\n"), done.stderr)

    def test_nothing_to_export(self):
        for text, words in (("{", "no whole JSON"), ("[]", "no result of this program")):
            path = self.folder.write("r.json", text)
            self.assertIn(words, run("export", path, "--to", "c", code=2).stderr)
        run("bound", NILE[0], "-n", 100, "-o", self.out, code=0)
        self.assertIn("holds no filter, vehicle or model of formulas", run("export", self.out, "--to", "c", code=2).stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
