"""forecast: outputs behind the last row, with intervals."""
import json
import math
import pathlib
import random
import unittest

from program import NILE, Folder, run, table


class Forecast(unittest.TestCase):
    """The level of the Nile at Durbin and Koopman's values: filtered variance 4032.158, then a random walk."""

    VALUES = "--set", "q=1469.1", "--set", "r=15099"

    def test_the_nile_as_durbin_and_koopman_have_it(self):
        head, rows = table(run("forecast", *NILE, "-n", 5, *self.VALUES, code=0).stdout)
        self.assertEqual(5, len(rows))
        self.assertEqual("time [s]", head[0])
        for h, row in enumerate(rows, 1):
            sd = math.sqrt(4032.1579418087836 + h * 1469.1 + 15099.0)
            self.assertAlmostEqual(row[1], 798.3702926083578, delta=1e-5)
            self.assertAlmostEqual(row[2], sd, delta=1e-5)
            self.assertAlmostEqual(row[3], row[1] - 1.959963985 * sd, delta=1e-4)
            self.assertAlmostEqual(row[4], row[1] + 1.959963985 * sd, delta=1e-4)

    def test_a_folder_and_json_say_the_same(self):
        with Folder() as made:
            folder = made.path
            printed = run("forecast", *NILE, "-n", 3, *self.VALUES, code=0).stdout
            text = run("forecast", *NILE, "-n", 3, *self.VALUES, "-o", folder / "out", "--json", code=0).stdout
            self.assertEqual(printed, (folder / "out" / "forecast.csv").read_text())
            ahead = json.loads(text)["forecast"]
            _, rows = table(printed)
            self.assertEqual([3, 1], [len(ahead["time"]), len(ahead["mean"])])
            for row, mean in zip(rows, ahead["mean"][0]):
                self.assertAlmostEqual(row[1], mean, delta=1e-6)

    def test_scenarios_have_the_mean_and_deviation_of_the_forecast(self):
        # 2000 scenarios: a mean off by 4.5 of its standard errors, or a deviation by 4.5 of its, is one case in 7000 among 10 numbers.
        forecast = table(run("forecast", *NILE, "-n", 5, *self.VALUES, code=0).stdout)[1]
        head, paths = table(run("forecast", *NILE, "-n", 5, *self.VALUES, "--scenarios", 2000, "--seed", 3, code=0).stdout)
        self.assertEqual("level_1", head[1])
        for row, path in zip(forecast, paths):
            values = path[1:]
            mean = sum(values) / len(values)
            sd = math.sqrt(sum((value - mean) ** 2 for value in values) / len(values))
            self.assertLess(abs(mean - row[1]), 4.5 * row[2] / math.sqrt(2000))
            self.assertLess(abs(sd / row[2] - 1), 4.5 / math.sqrt(4000))
        # One of them is one motion: neighbours differ by the level's step and two measurements, not by two forecasts.
        steps = [b - a for a, b in zip(paths[3][1:], paths[4][1:])]
        spread = sum(step**2 for step in steps) / len(steps)
        self.assertLess(abs(spread / (1469.1 + 2 * 15099) - 1), 4.5 * math.sqrt(2 / 2000))
        with Folder() as made:
            run("forecast", *NILE, "-n", 5, *self.VALUES, "--scenarios", 2000, "--seed", 3, "-o", made.path / "out", code=0)
            self.assertEqual(paths, table((made.path / "out/scenarios.csv").read_text())[1])
        self.assertIn("--seed does not apply", run("forecast", *NILE, "-n", 5, "--seed", 3, code=2).stderr)

    def test_it_is_as_the_recording_has_it(self):
        """The Nile in a column of other numbers: level = 4000 - 2 recorded; intervals and scenarios alike."""
        text = pathlib.Path(NILE[0]).read_text()
        lines = [line.split(",") for line in pathlib.Path(NILE[1]).read_text().split()]
        with Folder() as made:
            self.assertIn("column: volume}", text)
            model = made.write("other.yaml", text.replace("column: volume}", "column: volume, scale: -2, offset: 4000}"))
            other = made.write("other.csv", "\n".join([",".join(lines[0]), *(f"{year},{(4000 - float(flow)) / 2!r}" for year, flow in lines[1:])]))
            ahead = "-n", 3, *self.VALUES
            expected = table(run("forecast", *NILE, *ahead, code=0).stdout)[1]
            for row, (_, mean, sd, low, high) in zip(expected, table(run("forecast", model, other, *ahead, code=0).stdout)[1]):
                for value, there in zip(row[1:], (4000 - 2 * mean, 2 * sd, 4000 - 2 * high, 4000 - 2 * low)):
                    self.assertAlmostEqual(value, there, delta=1e-5)
            expected = table(run("forecast", *NILE, *ahead, "--scenarios", 50, code=0).stdout)[1]
            for row, there in zip(expected, table(run("forecast", model, other, *ahead, "--scenarios", 50, code=0).stdout)[1]):
                for value, recorded in zip(row[1:], there[1:]):
                    self.assertAlmostEqual(value, 4000 - 2 * recorded, delta=1e-5)

    def test_a_model_from_data_is_gone_on_from(self):
        """Its operating point is far from zero, and its states follow exactly from what was measured."""
        with Folder() as made:
            chance, rows, x = random.Random(1), ["u,y"], 3.0
            for t in range(300):
                u = (t * 7919 % 13) / 6.0 - 1.0
                rows.append(f"{u + 50!r},{x + 100 + chance.gauss(0, 0.03)!r}")
                x = 0.9 * x + 0.2 * u
            log, model = made.write("log.csv", "\n".join(rows)), str(made.path / "m.yaml")
            run("model", log, "--input", "u", "--output", "y", "-o", model)
            # Rows begin far from where they settle, so that their mean is no level: the innovations' is taken.
            self.assertNotIn("have a mean", run("check", model, log).stdout)
            for more in ((), ("--scenarios", 3)):
                for row in table(run("forecast", model, log, "-n", 2, "--inputs", log, *more).stdout)[1]:
                    self.assertLess(abs(row[1] - 100), 3)

    def test_values_that_were_found(self):
        with Folder() as made:
            folder = made.path
            run("tune", *NILE, "--starts", 1, "-o", folder / "out", code=0)
            _, rows = table(run("forecast", *NILE, "-n", 2, "--from", folder / "out", code=0).stdout)
            self.assertAlmostEqual(rows[0][1], 798.37, delta=0.1)

    def test_what_is_missing_is_said(self):
        self.assertIn("the number of rows to forecast is missing", run("forecast", *NILE, code=2).stderr)
        self.assertIn("--inputs does not apply", run("forecast", *NILE, "-n", 2, "--inputs", NILE[1], code=2).stderr)


if __name__ == "__main__":
    unittest.main()
