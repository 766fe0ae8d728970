"""Models of formulas that are not linear."""
import json
import math
import pathlib
import random
import re
import unittest

import jsonschema

from program import NILE, SCHEMA, SYSTEM_1, TORQUE, Folder, assert_same_rows, result, run, table


class FollowedMotion(unittest.TestCase):
    """Simulations whose likelihood is the equations', not the steps'."""

    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__)

    def simulated(self, model, rows):
        run("simulate", model, "-n", rows, "-o", self.folder.path / "out", code=0)
        return self.folder.path / "out/simulated.csv"

    def test_stiff_kinetics_from_starts_that_are_decades_off(self):
        """Robertson (1966): rates from 0.04 to 3e7, sampled every 4 s."""
        model = self.folder.write("robertson.yaml", """identikal: 1
time: {kind: continuous, step: 4 s}
parameters: {k: {value: 0.04, min: 1e-6, max: 1e3}, s: {value: 0.002, min: 0}}
states: [a, b, c]
dynamics: {a: -k*a + 1e4*b*c, b: k*a - 1e4*b*c - 3e7*b^2, c: 3e7*b^2}
outputs: {a: {column: a}, c: {column: c}}
noise: {measurement: {sd: {a: s, c: s}}}
initial: {mean: {a: 1, b: 0, c: 0}}
""")
        data = self.simulated(model, 60)
        near = result("fit", model, data, "--starts", 1)
        k = near["parameters"][0]
        self.assertLess(abs(k["value"] - 0.04), 3 * k["se"])
        for start in (1e-5, 4, 400):
            far = result("fit", model, data, "--starts", 1, "--set", f"k={start}")
            self.assertAlmostEqual(near["objective"]["log_likelihood"], far["objective"]["log_likelihood"], delta=1e-4, msg=start)
            self.assertAlmostEqual(k["value"], far["parameters"][0]["value"], delta=1e-3 * k["se"], msg=start)

    def test_a_step_by_hand_that_makes_another_likelihood_is_untrusted(self):
        text = """identikal: 1
time: {kind: continuous, step: 0.5 s}
parameters: {k: {value: 2, min: 0}, s: {value: 1e-4, min: 0}}
states: [x]
dynamics: {x: -k*x^2}
outputs: {x: {column: x}}
noise: {measurement: {sd: {x: s}}}
initial: {mean: {x: 1}}
"""
        model = self.folder.write("decay.yaml", text)
        data = self.simulated(model, 40)
        right = result("fit", model, data, "--starts", 1)
        self.assertEqual([], [w for w in right["warnings"] if w["code"] == "integration"])
        for step, code in (("0.5 s", 1), ("5 ms", 0)):
            by_hand = self.folder.write("step.yaml", text.replace("0.5 s", f"0.5 s, integration_step: {step}"))
            fit = result("fit", by_hand, data, "--starts", 1, code=code)
            said = [w["severity"] for w in fit["warnings"] if w["code"] == "integration"]
            self.assertEqual(["serious"] * code, said, step)
        self.assertAlmostEqual(right["objective"]["log_likelihood"], fit["objective"]["log_likelihood"], delta=1e-3)

    def test_a_step_by_hand_that_does_not_follow_is_not_taken(self):
        """A rate that the step is far too long for: no exit 2, and the same numbers as without it."""
        text = """identikal: 1
time: {kind: continuous, step: 0.5 s}
parameters: {k: {value: 0.3, min: 0}, s: {value: 1e-3, min: 0}}
states: [x, z]
dynamics: {x: -k*x*(1 + z), z: -1e4*(z - x^2)}
outputs: {x: {column: x}}
noise: {measurement: {sd: {x: s}}}
initial: {mean: {x: 1, z: 1}}
"""
        model = self.folder.write("pair.yaml", text)
        data = self.simulated(model, 40)
        by_hand = self.folder.write("step.yaml", text.replace("0.5 s", "0.5 s, integration_step: 0.1 s"))
        free, own = (result("fit", m, data, "--starts", 1) for m in (model, by_hand))
        self.assertEqual(free["parameters"], own["parameters"])
        self.assertEqual(["warning"], [w["severity"] for w in own["warnings"] if w["code"] == "integration"])

    def test_replicates_are_rows_of_one_time(self):
        """A decay measured three times at each time: the same as the curve that solves it, and in any order of the replicates."""
        decay = self.folder.write("decay.yaml", """identikal: 1
time: {kind: continuous, column: t, unit: s, sampling: irregular}
parameters: {k: {value: 0.3, min: 0.01, max: 10}, a: {value: 1, min: 0}, s: {value: 0.1, min: 0}}
states: [x]
dynamics: {x: -k*x*(1 + 0.1*x)}
outputs: {y: {column: y, equals: x}}
noise: {measurement: {sd: {y: s}}}
initial: {mean: {x: a}}
""")
        curve = self.folder.write("curve.yaml", """identikal: 1
model: static
parameters: {k: {value: 0.3, min: 0.01, max: 10}, a: {value: 1, min: 0}, s: {value: 0.1, min: 0}}
inputs: {h: {column: t}}
outputs: {y: {column: y, equals: a*exp(-k*h)/(1 + 0.1*a*(1 - exp(-k*h)))}}
noise: {measurement: {sd: {y: s}}}
""")
        source = random.Random(8)
        times = [0, 1, 2, 4, 7, 11]
        rows = [(t, 2 * math.exp(-0.4 * t) / (1 + 0.2 * (1 - math.exp(-0.4 * t))) + source.gauss(0, 0.05)) for t in times for _ in range(3)]
        again = [rows[3 * k + j] for k in range(len(times)) for j in (2, 0, 1)]
        found = []
        for model, order, name in ((decay, rows, "decay"), (decay, again, "again"), (curve, rows, "curve")):
            data = self.folder.write(f"{name}.csv", "t,y\n" + "".join(f"{t},{y!r}\n" for t, y in order))
            found.append(result("fit", model, data, "--starts", 1))
        self.assertIn("12 rows have the time of the row before", found[0]["inputs"][0].get("note", json.dumps(found[0])))
        for other in found[1:]:
            self.assertAlmostEqual(found[0]["objective"]["log_likelihood"], other["objective"]["log_likelihood"], delta=1e-6)
            for name in ("k", "a", "s"):
                p, q = (next(each for each in of["parameters"] if each["name"] == name) for of in (found[0], other))
                self.assertAlmostEqual(p["value"], q["value"], delta=1e-5 * abs(q["value"]), msg=name)
        refused = run("fit", self.folder.write("even.yaml", pathlib.Path(decay).read_text().replace(", sampling: irregular", "")),
                      self.folder.path / "decay.csv", code=2)
        self.assertIn("decay.csv:3: time 0 s is a duplicate", refused.stderr)

    def test_noise_that_no_number_scales_is_searched_as_it_is(self):
        """A variance s^2 + 1e-4 follows s by no power."""
        model = self.folder.write("offset.yaml", """identikal: 1
time: {kind: continuous, step: 0.1 s}
parameters: {k: {value: 0.5, min: 0}, s: {value: 0.02, min: 0}}
states: [x, z]
dynamics: {x: -k*x, z: -z^2}
outputs: {x: {column: x}}
noise: {measurement: {variance: {x: s^2 + 1e-4}}}
initial: {mean: {x: 1, z: 1}}
""")
        data = self.simulated(model, 100)
        ends = [result("fit", model, data, "--starts", 1, "--set", f"s={s}")["objective"]["log_likelihood"] for s in (0.001, 0.02, 10)]
        self.assertAlmostEqual(ends[0], ends[1], delta=1e-3)
        self.assertAlmostEqual(ends[2], ends[1], delta=1e-3)

    def test_a_tank_that_begins_empty_is_simulated(self):
        """The slope of sqrt(h) at 0 is no number; the motion is."""
        model = self.folder.write("tank.yaml", """identikal: 1
time: {kind: continuous, step: 0.1 s}
parameters: {c: {value: 1, min: 0.1}, s: {value: 1e-3, min: 0}}
states: [h]
dynamics: {h: 1 - c*sqrt(h)}
outputs: {h: {column: h}}
noise: {measurement: {sd: {h: s}}}
initial: {mean: {h: 0}}
""")
        self.simulated(model, 100)


class Nonlinear(unittest.TestCase):
    """The pendulum of the templates, from its own simulation."""


    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__)
        self.model = self.folder.write("pendulum.yaml", run("init", "pendulum", code=0).stdout)
        self.out = self.folder.path / "out"

    def simulated(self, seed, rows=400):
        out = self.folder.path / f"data{seed}"
        run("simulate", self.model, "-n", rows, *TORQUE, "--seed", seed, "-o", out, code=0)
        return out / "simulated.csv"

    def test_steps_do_not_depend_on_the_start(self):
        """A pendulum at rest moves in its deviations alone, and a search begun where all is slow ends where it is fast."""
        model = self.folder.write("swing.yaml", run("init", "pendulum", code=0).stdout.replace("{phi: 20 deg, w: 0}", "{phi: 0, w: 0}"))
        near = result("fit", model, self.simulated(1), "--starts", 1)
        far = result("fit", model, self.simulated(1), "--starts", 1, "--set", "l=4")
        for a, b in zip(near["parameters"], far["parameters"]):
            self.assertAlmostEqual(a["value"], b["value"], delta=1e-3 * (a["se"] or 0), msg=a["name"])
        self.assertAlmostEqual(near["objective"]["log_likelihood"], far["objective"]["log_likelihood"], delta=1e-3)

    def test_a_swing_from_a_known_start_is_information(self):
        """The paths agree on it: a linear model that begins far from rest."""
        model = self.folder.write("swing.yaml", """identikal: 1
time: {kind: continuous, step: 0.05 s}
parameters: {k: {value: 25, min: 0.1}, c: {value: 0.5, min: 0}, q: {value: 0.01, min: 0}, r: {value: 1e-5, min: 0}}
states: [x, v]
dynamics: {x: v, v: -c*v - k*x}
outputs: {x: {column: x}}
noise: {process: {kind: density, variance: {v: q}}, measurement: {variance: {x: r}}}
initial: {mean: {x: 0.3, v: 0}, sd: {x: 0.01, v: 0.1}}
""")
        run("simulate", model, "-n", 500, "-o", self.out, code=0)
        tuned = {path: result("tune", model, self.out / "simulated.csv", "--starts", 1, *more)
                 for path, more in (("compressed", ()), ("steady", ("--evaluation", "steady-state")), ("direct", ("--evaluation", "time-varying")))}
        # The evaluation from sample autocovariances counts all 500 samples as those of a steady filter, so that errors agree to one of them.
        for path, of_errors in (("steady", 1e-5), ("compressed", 1 / 500)):
            self.assertEqual({"steady": "steady_state_filter", "compressed": "sample_autocovariances"}[path], tuned[path]["objective"]["evaluation_method"])
            for a, b in zip(tuned[path]["parameters"], tuned["direct"]["parameters"]):
                self.assertAlmostEqual(a["value"] / b["value"], 1, delta=1e-5, msg=(path, a["name"]))
                for number in ("se", "crb_se"):
                    self.assertAlmostEqual(a[number] / b[number], 1, delta=of_errors, msg=(path, a["name"], number))

    def test_jumps_and_haste_of_the_rates_are_said(self):
        """Dry friction, whose sign no number of steps follows; and a rate that wants more steps than there are."""
        text = run("init", "pendulum", code=0).stdout
        data = self.simulated(8, 100)
        for rates, least, most in (("- d*d*sign(w)", 1e-6, 1e-2), ("- d*w + 1e6*d*d*sin(1e6*d*t)", 1e-3, 10)):
            model = self.folder.write("m.yaml", text.replace("- d*w", rates))
            said = [w for w in json.loads(run("check", model, data, "--json").stdout)["warnings"] if w["code"] == "integration"]
            self.assertEqual(1, len(said), rates)
            size = float(re.search(r"from t = [0-9.]+ s on .* by up to ([0-9.e-]+) of its size", said[0]["text"]).group(1))
            self.assertTrue(least < size < most, said[0]["text"])
            self.assertEqual("warning" if size > 1e-3 else "note", said[0]["severity"])
        self.assertFalse([w for w in result("check", self.model, data)["warnings"] if w["code"] == "integration"])

    def test_fit_filter_validate(self):
        data, other = self.simulated(1), self.simulated(2)
        text = run("fit", self.model, data, "--hold-out", "30%", "--starts", 1, "-o", self.out, code=0).stdout
        self.assertLessEqual(max(map(len, text.splitlines())), 80)
        fitted = json.loads((self.out / "result.json").read_text())
        jsonschema.validate(fitted, SCHEMA)
        fits = {kind: fit["angle"]["fit_percent"] for kind, fit in fitted["fit"].items() if kind != "driven"}
        for kind in ("one_step", "hold_out_one_step"):
            self.assertGreater(fits[kind], 99)
        for kind in ("simulation", "hold_out"):
            self.assertGreater(fits[kind], 80)
            self.assertLess(fits[kind], fits["one_step"])
        for line in ("fit    simulation", "fit    hold-out", "fit    one step, hold-out"):
            self.assertIn(line, text)
        self.assertEqual((400, 280), (fitted["inputs"][0]["rows"], fitted["inputs"][0]["used"]))
        page = json.loads((self.out / "report_data.json").read_text())
        angle = page["channels"][0]
        self.assertTrue(all(angle[line] for line in ("measured", "one_step", "simulation")))
        self.assertIsNotNone(page["held_from"])

        head, filtered = table(run("filter", self.model, data, "--from", self.out, code=0).stdout)
        self.assertEqual(["time [s]", "phi [rad]", "phi_sd [rad]", "w [rad/s]", "w_sd [rad/s]"], head)
        smoothed = table(run("filter", self.model, data, "--from", self.out, "--smooth", code=0).stdout)[1]
        lagged = table(run("filter", self.model, data, "--from", self.out, "--lag", 1000, code=0).stdout)[1]
        self.assertEqual(smoothed, lagged)
        assert_same_rows(self, [filtered[-1]], [smoothed[-1]])
        for before, after in zip(filtered[50:350], smoothed[50:350]):
            self.assertLess(after[4], 0.9 * before[4])
        run("filter", self.model, data, "--from", self.out, "-o", self.folder.path / "states", code=0)
        innovations = table((self.folder.path / "states/innovations.csv").read_text())[1]
        for time, e, sd, z, _ in innovations:
            self.assertAlmostEqual(z, e / sd, delta=1e-6 * (1 + abs(z)))

        held = result("validate", self.out, other)
        self.assertGreater(held["fit"]["simulation"]["angle"]["fit_percent"], 80)
        self.assertEqual({"score", "nis", "ljung_box", "input_correlation"}, {t["id"] for t in held["tests"]})
        self.assertEqual("rejected", result("validate", self.out, self.spoilt(other), code=1)["status"]["code"])

    def test_starts_within_a_recording_are_said(self):
        lines = self.simulated(1, 100).read_text().splitlines()
        header = next(i for i, line in enumerate(lines) if "torque" in line and not line.startswith("#"))
        column = next(i for i, name in enumerate(lines[header].split(",")) if name.startswith("torque"))
        row = next(i for i in range(header + 1, len(lines)) if lines[i][0] in "-0123456789") + 10
        cells = lines[row].split(",")
        cells[column] = ""
        gap = self.folder.write("gap.csv", "\n".join([*lines[:row], ",".join(cells), *lines[row + 1:]]) + "\n")

        def warnings(*arguments):
            out = json.loads(run("filter", self.model, *arguments, "--json").stdout)
            return {w["code"]: w for w in out["warnings"]}

        said = warnings(gap)["starts_anew"]
        self.assertEqual("warning", said["severity"])
        self.assertIn("restarts from 'initial' at t = 0.22 s, after a missing input", said["text"])
        said = warnings(self.simulated(1, 100), "--range", "1:4")
        self.assertIn("the filter goes on from the 50 rows before", said["goes_on"]["text"])
        self.assertNotIn("starts_within", said)
        both = warnings(self.simulated(1, 100), self.simulated(2, 100), "--range", "1:4")
        self.assertIn("the filter goes on from the 50 rows before", both["goes_on"]["text"])
        self.assertNotIn("starts_within", both)
        gone = warnings(self.simulated(1, 100), gap, "--range", "0.1:4")["starts_within"]
        self.assertEqual("note", gone["severity"])
        self.assertIn("at t = 0.1 s, where --range begins", gone["text"])
        self.assertNotIn("starts_anew", warnings(self.simulated(1, 100)))

    def test_advice_is_for_the_model_at_hand(self):
        data = self.simulated(1, 100)
        self.assertIn("--evaluation does not apply to this model", run("tune", self.model, data, "--evaluation", "steady-state", code=2).stderr)
        short = self.simulated(2, 9)
        out = json.loads(run("fit", self.model, short, "--starts", 1, "--json").stdout)
        self.assertIn("9 samples for 4 unknowns", {w["code"]: w for w in out["warnings"]}["few_samples"]["text"])
        text = pathlib.Path(self.model).read_text()
        still = self.folder.write("still.yaml", text.replace("sin(phi)", "sin(phi)/20").replace("l: {value: 0.8 m, min: 0.1, max: 5}", "l: 0.8 m"))
        out = json.loads(run("fit", still, self.simulated(3), "--starts", 1, "--json").stdout)
        said = [w["remedy"] for w in out["warnings"] if w["code"] == "coloured_innovations"]
        self.assertTrue(said)
        self.assertNotIn("shape", " ".join(said))

    def test_where_a_filter_has_no_numbers(self):
        tank = self.folder.write("tank.yaml", """identikal: 1
name: tank
time: {kind: discrete, step: 1 s}
parameters: {c: {value: 0.1}, q: {value: 0.01, min: 0}, r: {value: 1e-4, min: 0}}
states: [h]
dynamics: {h: h - c*sqrt(h)}
outputs: {level: {column: level, equals: h}}
noise: {process: {kind: per-sample, variance: {h: q}}, measurement: {variance: {level: r}}}
initial: {mean: {h: 1}, sd: {h: 0.1}}
""")
        levels = [1, 0.9, 0.8, 0.7, 0.6, -5, 0.5, 0.4, 0.3, 0.2]
        data = self.folder.write("levels.csv", "level\n" + "".join(f"{v}\n" for v in levels))
        for verb in ("filter", "tune"):
            said = run(verb, tank, data, code=2).stderr
            # The state is below zero once the sixth level is known, and has no root.
            self.assertIn("levels.csv: the filter has no numbers at t = 6 s (sample 7)", said)
            self.assertNotIn("input is missing", said)
            self.assertNotIn("semidefinite", said)

    def test_another_step_than_the_file_s(self):
        with Folder() as folder:
            model = folder.write("model.yaml", SYSTEM_1.replace("step: 1 s", "step: 10 ms"))
            rows = "".join(f"{20 * t},{math.sin(t * t)}\n" for t in range(60))
            data = folder.write("data.csv", "t [ms],y\n" + rows)
            warning = {w["code"]: w for w in json.loads(run("filter", model, data, "--json").stdout)["warnings"]}["step_differs"]
            self.assertIn("0.01 s from row to row, column 't' of data.csv 0.02 s", warning["text"])
            data = folder.write("data.csv", "t [ms],y\n" + "".join(f"{10 * t},{math.sin(t * t)}\n" for t in range(60)))
            self.assertEqual([], json.loads(run("filter", model, data, "--json").stdout)["warnings"])

    def spoilt(self, data):
        """The angle four times as noisy."""
        generator = random.Random(1)
        lines = [line for line in data.read_text().splitlines() if not line.startswith("#")]
        column = [name.split(" ")[0] for name in lines[0].split(",")].index("angle")
        rows = [line.split(",") for line in lines[1:]]
        for row in rows:
            row[column] = repr(float(row[column]) + generator.gauss(0, 2.2))
        return self.folder.write("spoilt.csv", "\n".join([lines[0], *(",".join(row) for row in rows)]) + "\n")

    def test_check(self):
        data = self.simulated(3)
        out = result("check", self.model, data)
        self.assertEqual("extended", out["objective"]["filter"])
        self.assertAlmostEqual(sum(t["level"] or 0 for t in out["tests"]), 0.05)
        self.assertIn("excess mean-square error", [d["name"] for d in out["derived"]])
        out = result("check", self.model, data, "--set", "r=1e-5", code=1)
        self.assertIn("r should be larger", out["status"]["message"])
        text = run("check", self.model, data, code=0).stdout
        self.assertIn("tests of a nonlinear filter take its innovations for Gaussian", " ".join(text.split()))
        other = self.folder.write("other.yaml", pathlib.Path(self.model).read_text().replace("r: {value: 1e-4", "r: {value: 1e-5"))
        out = result("compare", other, self.model, data)
        self.assertIn("pendulum.yaml has the highest likelihood", out["status"]["message"])

    def test_the_filter_of_a_result_is_kept(self):
        data = self.simulated(4, 200)
        tuned = json.loads(run("fit", self.model, data, "--starts", 1, "--filter", "unscented", "--json", "-o", self.out, code=0).stdout)
        again = result("filter", self.model, data, "--from", self.out)
        self.assertEqual(("unscented", "unscented"), (tuned["objective"]["filter"], again["objective"]["filter"]))
        # The values say how many steps the integration takes: from the file's, and from those found.
        self.assertAlmostEqual(tuned["objective"]["log_likelihood"], again["objective"]["log_likelihood"], delta=1e-5)
        extended = result("filter", self.model, data, "--from", self.out, "--filter", "extended")
        self.assertNotAlmostEqual(tuned["objective"]["log_likelihood"], extended["objective"]["log_likelihood"], delta=1e-3)

    def test_bound(self):
        out = result("bound", self.model, "-n", 400, *TORQUE, "--accuracy", "1%")
        self.assertEqual((50, 1), (out["bound"]["simulated"]["recordings"], out["bound"]["simulated"]["seed"]))
        self.assertLess(out["bound"]["simulated"]["relative_se"], 0.03)
        # The errors of a fit to one such recording.
        fitted = result("fit", self.model, self.simulated(5), "--starts", 1)
        seen = {p["name"]: p["crb_se"] for p in fitted["parameters"]}
        for p, needed in zip(out["parameters"], out["bound"]["parameters"]):
            if p["fixed"]:
                continue
            self.assertLess(abs(math.log(p["crb_se"] / seen[p["name"]])), math.log(1.5), p["name"])
            self.assertAlmostEqual(needed["samples_needed"], 400 * (p["crb_se"] / p["value"] / 0.01) ** 2, delta=1)
        recorded = result("bound", self.model, self.simulated(5))
        for p, q in zip(out["parameters"], recorded["parameters"]):
            if not p["fixed"]:
                self.assertAlmostEqual(p["crb_se"], q["crb_se"], delta=1e-3 * p["crb_se"])

    def test_what_it_cannot_do(self):
        data = self.simulated(6, 60)
        for words, arguments in (("input 'torque' is not given", ("bound", self.model, "-n", 100)),
                                 ("both --input and a recording", ("bound", self.model, data, *TORQUE)),
                                 ("--runs does not apply to this model", ("bound", *NILE[:1], "-n", 100, "--runs", 7)),
                                 ("--bootstrap does not apply to a filter", ("fit", self.model, data, "--bootstrap", 100)),
                                 ("--method trajectory does not apply to a filter", ("fit", self.model, data, "--method", "trajectory")),
                                 ("leaves too little", ("tune", self.model, data, "--hold-out", "95%")),
                                 ("takes a linear model", ("shape", self.model, data)),
                                 ("takes a linear model", ("tune", self.model, data, "--method", "auto")),
                                 ("takes a linear model", ("tune", self.model, data, "--method", "als")),
                                 ("--filter does not apply to this model", ("filter", *NILE, "--filter", "iterated"))):
            done = run(*arguments, code=2)
            self.assertEqual(("", 1), (done.stdout, done.stderr.count("\n")))
            self.assertIn(words, done.stderr)

    def test_linear_models_hold_out_too(self):
        out = result("tune", *NILE, "--hold-out", "30%", "--starts", 1)
        self.assertEqual(["level"], list(out["fit"]["hold_out_one_step"]))
        values = [f"--set={p['name']}={p['value']!r}" for p in out["parameters"]]
        everything = result("filter", *NILE, *values)["objective"]["log_likelihood"]
        rows = {d["name"].strip(): d["value"] for d in out["derived"]}
        self.assertAlmostEqual(70 * rows["log-likelihood per row"] + 30 * rows["on held-out rows"], everything, delta=1e-6)
        self.assertNotIn("hold_out", [w["code"] for w in out["warnings"]])

    def test_held_out_rows_of_another_noise_are_seen(self):
        for name, r in (("same", 15099), ("other", 40000)):
            run("simulate", NILE[0], "-n", 400, "--seed", 3, "--set", "q=1469", "--set", f"r={r}", "-o", self.folder.path / name, code=0)
        data = [self.folder.path / name / "simulated.csv" for name in ("same", "other")]
        said = {held: [w["text"] for w in result("tune", NILE[0], data[0], "--hold-out", held, "--starts", 1)["warnings"] if w["code"] == "hold_out"]
                for held in ("50%", data[1])}
        self.assertEqual([], said["50%"])
        self.assertRegex(said[data[1]][0], r"innovations are 1\.[3-6][0-9]* times as large")


if __name__ == "__main__":
    unittest.main(verbosity=2)
