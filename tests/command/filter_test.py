"""filter: states and innovations."""
import json
import math
import os
import pathlib
import unittest

import jsonschema

from program import LANE_CHANGE, NILE, ROOT, SCHEMA, SYSTEM_1, Folder, assert_same_rows, result, run, shared, table


class Filter(unittest.TestCase):
    """The level of the Nile at Durbin and Koopman's values against statsmodels 0.13.5, local level with a diffuse start."""

    VALUES = "--set", "q=1469.1", "--set", "r=15099"

    def test_states_on_standard_output(self):
        head, rows = table(run("filter", *NILE, *self.VALUES, code=0).stdout)
        self.assertEqual(["time [s]", "level", "level_sd"], head)
        self.assertEqual(100, len(rows))
        for t, level, variance in ((0, 1120.0, 15099.0), (1, 1140.927839934822, 7899.7363793969125), (27, 1133.1262912421244, 4032.158206950185),
                                   (99, 798.3702926083578, 4032.1579418087836)):
            self.assertAlmostEqual(rows[t][1], level, delta=1e-5)
            self.assertAlmostEqual(rows[t][2] ** 2, variance, delta=1e-4)
        head, rows = table(run("filter", *NILE, *self.VALUES, "--smooth", code=0).stdout)
        for t, level, variance in ((0, 1111.6683191267957, 4032.1579418084766), (27, 999.585218705269, 2326.756958102708), (98, 804.0495956662394, 3242.9300732249258)):
            self.assertAlmostEqual(rows[t][1], level, delta=1e-5)
            self.assertAlmostEqual(rows[t][2] ** 2, variance, delta=1e-4)
        assert_same_rows(self, table(run("filter", *NILE, "--lag", 200).stdout)[1], table(run("filter", *NILE, "--smooth").stdout)[1])
        self.assertEqual(run("filter", *NILE, "--lag", 0).stdout, run("filter", *NILE).stdout)
        # The record up to 5 years later.
        head, lagged = table(run("filter", *NILE, "--lag", 5).stdout)
        head, until = table(run("filter", *NILE, "--smooth", "--range", "0:55").stdout)
        self.assertEqual(lagged[50], until[50])

    def test_files_and_summary(self):
        with Folder() as folder:
            out = folder.path / "out"
            text = run("filter", *NILE, *self.VALUES, "-o", out, code=0).stdout
            self.assertLessEqual(max(map(len, text.splitlines())), 80)
            self.assertIn("state  level", text)
            self.assertIn("798.37 +- 63.5", text)
            self.assertEqual(["innovations.csv", "predictions.csv", "result.json", "states.csv"], sorted(os.listdir(out)))
            jsonschema.validate(json.loads((out / "result.json").read_text()), SCHEMA)
            head, rows = table((out / "innovations.csv").read_text())
            self.assertEqual(["time [s]", "level_innovation", "level_sd", "level_standardised", "log_likelihood"], head)
            self.assertEqual([0, None, None, None, None], rows[0])
            # Second year: 1160 - 1120, variance r + (r + q).
            self.assertAlmostEqual(rows[1][1], 40)
            self.assertAlmostEqual(rows[1][2], (15099 + 15099 + 1469.1) ** 0.5, delta=1e-5)
            self.assertAlmostEqual(rows[1][3], 40 / (15099 + 15099 + 1469.1) ** 0.5, delta=1e-7)

    def test_outputs_are_predicted_where_nothing_was_measured(self):
        with Folder() as folder:
            model = folder.write("model.yaml", """identikal: 1
time: {step: 1 s}
components: {level: {kind: level, variance: 0.5, output: [a, b]}, rest: {kind: ar, coefficients: [0.5], variance: 1, output: b}}
outputs: {a: {column: a}, b: {column: b}}
noise: {measurement: {variance: {a: 2, b: 3}}}
""")
            data = folder.write("data.csv", "a,b\n1,2\n2,1\n,3\n,\n4,2\n")
            run("filter", model, data, "-o", folder.path / "out", code=0)
            head, rows = table((folder.path / "out/predictions.csv").read_text())
            self.assertEqual(["time [s]", "a", "a_sd", "b", "b_sd", "a_b_correlation"], head)
            _, states = table((folder.path / "out/states.csv").read_text())
            innovations = table((folder.path / "out/innovations.csv").read_text())[1]
            for t in (2, 3):  # from the filtered state of the row before
                self.assertAlmostEqual(rows[t][1], states[t - 1][1], delta=1e-12)
                self.assertAlmostEqual(rows[t][3], states[t - 1][1] + 0.5 * states[t - 1][3], delta=1e-12)
            self.assertAlmostEqual(rows[3][2] ** 2, states[2][2] ** 2 + 0.5 + 2, delta=1e-10)
            self.assertAlmostEqual(rows[4][1], 4 - innovations[4][1], delta=1e-12)
            covariance = rows[3][5] * rows[3][2] * rows[3][4]
            self.assertLess(0, covariance)
            self.assertLess(covariance, rows[3][2] ** 2 - 2)

    def test_noise_of_states_and_outputs_given_the_whole_recording(self):
        with Folder() as folder:
            out = folder.path / "out"
            run("filter", *NILE, *self.VALUES, "--smooth", "-o", out, code=0)
            head, rows = table((out / "disturbances.csv").read_text())
            self.assertEqual(["time [s]", "level_noise", "level_noise_sd", "level_error", "level_error_sd", "level_jump_t", "level_error_t"], head)
            levels = [row[1] for row in table((out / "states.csv").read_text())[1]]
            flow = [row[1] for row in table(pathlib.Path(NILE[1]).read_text())[1]]
            for t in range(99):
                self.assertAlmostEqual(rows[t][1], levels[t + 1] - levels[t], delta=1e-7)
                self.assertAlmostEqual(rows[t][3], flow[t] - levels[t], delta=1e-7)
            # Durbin and Koopman (2012), figure 2.3: 1916 (row 45) and the drop of 1899 (row 28) stand out.
            self.assertEqual(28, max(range(99), key=lambda t: abs(rows[t][5])) + 1)
            for row in rows[:99]:
                self.assertAlmostEqual(row[6], row[3] / row[4], delta=1e-9)

    def test_trajectories_of_the_states(self):
        with Folder() as folder:
            out = folder.path / "out"
            run("filter", *NILE, *self.VALUES, "--smooth", "--trajectories", 400, "-o", out, code=0)
            head, rows = table((out / "trajectories.csv").read_text())
            self.assertEqual(["trajectory", "time [s]", "level"], head)
            states = table((out / "states.csv").read_text())[1]
            for t in (0, 50, 99):  # 4.5 standard errors: six numbers, one false alarm in 25,000
                values = [row[2] for row in rows if row[1] == t]
                mean = sum(values) / 400
                sd = math.sqrt(sum((value - mean) ** 2 for value in values) / 400)
                self.assertLess(abs(mean - states[t][1]), 4.5 * states[t][2] / 20)
                self.assertLess(abs(sd / states[t][2] - 1), 4.5 / math.sqrt(800))
            self.assertIn("--trajectories alone", run("filter", *NILE, "--trajectories", 3, code=2).stderr)

    def test_log_likelihood_by_row(self):
        with Folder() as folder:
            out = folder.path / "out"
            run("filter", *NILE, *self.VALUES, "-o", out, code=0)
            head, rows = table((out / "innovations.csv").read_text())
            _, e, sd, z, by_row = rows[1]
            self.assertEqual(z, e / sd)  # cells read back to the same numbers
            self.assertAlmostEqual(by_row, -0.5 * (math.log(2 * math.pi * sd**2) + z**2), delta=1e-12)
            behind = result("filter", *NILE, *self.VALUES, "--skip-first", 5)["objective"]["log_likelihood"]
            self.assertAlmostEqual(behind, sum(row[4] for row in rows[5:]), delta=1e-10)
            self.assertIn("nothing is predicted behind the first 5000 rows", run("filter", *NILE, "--skip-first", 5000, code=2).stderr)

    def test_values_of_a_result(self):
        with Folder() as folder:
            tuned = folder.path / "tuned"
            run("tune", *NILE, "-o", tuned, code=0)
            values = {p["name"]: p["value"] for p in json.loads((tuned / "result.json").read_text())["parameters"]}
            typed = run("filter", *NILE, "--set", f"q={values['q']!r}", "--set", f"r={values['r']!r}", code=0).stdout
            self.assertEqual(typed, run("filter", *NILE, "--from", tuned, code=0).stdout)
            out = result("filter", *NILE, "--from", tuned / "result.json", "--set", "q=5")
            self.assertEqual({"q": 5, "r": values["r"]}, {p["name"]: p["value"] for p in out["parameters"]})
            text = pathlib.Path(NILE[0]).read_text()
            other = folder.write("other.yaml", text.replace("q:", "q2:").replace("[[q]]", "[[q2]]"))
            self.assertIn("no parameter 'q'", run("filter", other, NILE[1], "--from", tuned, code=2).stderr)

    def test_matrices_of_a_result(self):
        with Folder() as folder:
            data, model = shared("noise/sys1.csv"), folder.write("model.yaml", SYSTEM_1.replace("column: y", "column: 1"))
            run("tune", model, data, "-o", folder.path / "tuned", code=0)
            out = result("filter", model, data, "--from", folder.path / "tuned")
            tuned = json.loads((folder.path / "tuned/result.json").read_text())
            self.assertEqual(tuned["noise"]["Q"]["matrix"], out["noise"]["Q"]["matrix"])
            self.assertEqual(tuned["objective"]["log_likelihood"], out["objective"]["log_likelihood"])

    def test_time_stamps_and_missing_rows(self):
        with Folder() as folder:
            model = folder.write("model.yaml", SYSTEM_1.replace("step: 1 s", "column: t, unit: ms, step: 0.1 s"))
            stamps = [5000 + 100.3 * k for k in range(60) if k not in (20, 21)]
            data = folder.write("data.csv", "t,y\n" + "".join(f"{t},{(7 * k) % 5 - 2}\n" for k, t in enumerate(stamps)))
            head, rows = table(run("filter", model, data, code=0).stdout)
            self.assertEqual(60, len(rows))
            recorded = [row for k, row in enumerate(rows) if k not in (20, 21)]
            for row, t in zip(recorded, stamps):
                self.assertAlmostEqual(row[0], t / 1000, delta=1e-9)
            self.assertAlmostEqual(rows[20][0], rows[19][0] + 0.1, delta=1e-9)
            self.assertAlmostEqual(rows[20][1], 0.5 * rows[19][1], delta=1e-8)
            self.assertAlmostEqual(rows[20][2] ** 2, 0.25 * rows[19][2] ** 2 + 1, delta=1e-6)

    def test_several_recordings(self):
        with Folder() as folder:
            head, rows = table(run("filter", NILE[0], NILE[1], NILE[1], "--smooth", code=0).stdout)
            self.assertEqual(["recording", "time [s]", "level", "level_sd"], head)
            self.assertEqual([1] * 100 + [2] * 100, [row[0] for row in rows])
            self.assertEqual(rows[17][1:], rows[117][1:])

    def test_a_long_recording(self):
        with Folder() as folder:
            run("simulate", ROOT / "examples/system7.yaml", "-n", 20000, "-o", folder.path, code=0)
            data = folder.path / "simulated.csv"
            model = ROOT / "examples/system7.yaml"
            _, interval = table(run("filter", model, data, "--smooth", code=0).stdout)
            _, lagged = table(run("filter", model, data, "--lag", 400, code=0).stdout)
            self.assertEqual(20000, len(interval))
            for t in range(0, 20000, 997):
                for a, b in zip(interval[t], lagged[t]):
                    self.assertAlmostEqual(a, b, delta=1e-7 * (1 + abs(a)))

    def test_what_it_cannot_do(self):
        for words, arguments in ((["'filter' takes the model of a filter, this is a vehicle; expected a model with A, C, Q, R, or formulas; use 'fit'"], LANE_CHANGE), (["--smooth and --lag"], (*NILE, "--smooth", "--lag", 3)),
                                 (["cannot be read"], (*NILE, "--from", "/nowhere"))):
            done = run("filter", *arguments, code=2)
            self.assertEqual(("", 1), (done.stdout, done.stderr.count("\n")))
            for word in words:
                self.assertIn(word, done.stderr)


class TestWeights(unittest.TestCase):
    def test_of_the_nile(self):
        with Folder() as folder:
            run("filter", *NILE, "--smooth", "--weights", "50s", "-o", folder.path / "out")
            lines = (folder.path / "out/weights.csv").read_text().splitlines()
            self.assertEqual(lines[0], "time [s],level by level")
            weights = [float(line.split(",")[1]) for line in lines[1:]]
            self.assertEqual(len(weights), 100)
            self.assertAlmostEqual(sum(weights), 1.0, 9)
            self.assertEqual(max(weights), weights[50])
            self.assertAlmostEqual(weights[49], weights[51], 6)

    def test_mistakes(self):
        with Folder() as folder:
            for more, said in ((["--weights", "50s"], "--weights alone; expected -o FOLDER"),
                               (["--weights", "500s", "-o", folder.path / "out"], "--weights 500s; expected 0 to 99 s after the first row"),
                               (["--weights", "0s", "-o", folder.path / "out"], None),
                               (["--weights", "much", "-o", folder.path / "out"], "--weights 'much'")):
                done = run("filter", *NILE, *more, code=0 if said is None else 2)
                self.assertIn(said or "", done.stderr)


if __name__ == "__main__":
    unittest.main(verbosity=2)
