"""model: a linear model from recordings alone."""
import datetime
import json
import math
import random
import unittest

from program import SHARED, Folder, result, run


def motor(rows, seed, level=(0.0, 0.0)):
    """Speed of a motor, a lag of 0.9 and an oscillation, by its voltage; noise of a tenth."""
    draw, x, y = random.Random(seed), [0.0, 0.0, 0.0], []
    u = [draw.gauss(0, 1) for _ in range(rows)]
    for voltage in u:
        e = 0.1 * draw.gauss(0, 1)
        y.append(x[0] + x[1] + e)
        x = [0.9 * x[0] + 0.4 * voltage + 0.2 * e, 0.5 * x[1] + 0.6 * x[2] + 0.3 * voltage, -0.6 * x[1] + 0.5 * x[2]]
    return [(0.01 * t, u[t] + level[0], y[t] + level[1]) for t in range(rows)]


def table(rows, head="t [s],voltage [V],speed [rad/s]"):
    return head + "\n" + "".join(",".join(f"{value:.12g}" for value in row) + "\n" for row in rows)


OF_MOTOR = "--input", "voltage", "--output", "speed"


class Model(unittest.TestCase):
    def test_days_of_the_week_follow_each_other(self):
        """Dates are the time where rows are equally far apart; of five days a week they are not, and rows count."""
        with Folder() as made:
            model = made.path / "model.yaml"
            for days, column in ((range(7), 'column: "date"'), (range(5), "step: 1")):
                dates = [datetime.date(2024, 1, 1) + datetime.timedelta(k) for k in range(400)]
                used = [each for each in dates if each.weekday() in days]
                rows = "".join(f"{each},{math.sin(0.7 * k) + 0.1 * (k * k % 7)}\n" for k, each in enumerate(used))
                data = made.write("log.csv", "date,y\n" + rows)
                run("model", data, "--output", "y", "--order", "1:3", "-o", model)
                self.assertIn(column, model.read_text())

    def test_a_known_motor_is_found_with_its_noise(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(3000, 1)))
            found = result("model", log, *OF_MOTOR, "--for", "prediction")
            box = found["black_box"]
            self.assertEqual(3, box["order"])
            self.assertEqual("ok", found["status"]["code"])
            real = sorted(pole["real"] for pole in box["poles"])
            for value, truth in zip(real, (0.5, 0.9)):
                self.assertAlmostEqual(value, truth, delta=0.02)
            for pole, truth in zip(sorted(box["poles"], key=lambda each: each["real"]), (0.5, 0.9)):
                self.assertLess(abs(pole["real"] - truth), 4 * pole["real_se"])
            gain = 0.4 / 0.1 + 0.3 * 0.5 / (0.25 + 0.36)
            self.assertLess(abs(box["gain"][0][0] - gain), 4 * box["gain_se"][0][0])
            self.assertAlmostEqual(0.01, found["filter"]["dt"])
            self.assertEqual(3, len(found["filter"]["K"]))
            self.assertAlmostEqual(0.01, found["noise"]["R"]["matrix"][0][0], delta=0.001)

    def test_its_model_file_serves_the_other_verbs(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(1500, 2, (2.0, 30.0))))
            fresh = made.write("fresh.csv", table(motor(1500, 3, (2.0, 30.0))))
            run("model", log, *OF_MOTOR, "-o", made.path / "motor.yaml", code=0)
            run("model", log, *OF_MOTOR, "-o", made.path / "out", code=0)
            self.assertEqual((made.path / "motor.yaml").read_text(), (made.path / "out/model.yaml").read_text())
            self.assertIn("offset: -", (made.path / "motor.yaml").read_text())
            checked = result("check", made.path / "motor.yaml", fresh)
            self.assertTrue(all(test["pass"] for test in checked["tests"] if test["id"] == "ljung_box"), checked["tests"])
            head = run("filter", made.path / "motor.yaml", fresh, code=0).stdout.splitlines()[0]
            self.assertIn("time", head)
            run("export", made.path / "out", "--to", "c", "-o", made.path / "code", code=0)
            validated = result("validate", made.path / "out", fresh)
            self.assertGreater(min(fit["fit_percent"] for fit in validated["fit"]["one_step"].values()), 80)

    def test_orders_purposes_and_units(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(1200, 4)))
            self.assertEqual(4, result("model", log, *OF_MOTOR, "--order", 4)["black_box"]["order"])
            orders = {each["order"] for each in result("model", log, *OF_MOTOR, "--order", "2:5")["black_box"]["candidates"]}
            self.assertEqual({2, 3, 4, 5}, orders)
            simulator = result("model", log, *OF_MOTOR, "--for", "simulation")["black_box"]
            self.assertEqual("simulation", simulator["purpose"])
            controller = run("model", log, *OF_MOTOR, "--for", "control", "--steps", "15").stdout
            self.assertIn("control: 1 to 15 rows ahead together", " ".join(controller.split()))
            self.assertLessEqual(max(map(len, controller.splitlines())), 80)
            self.assertRegex(controller, r"\n +3 prediction_error +-\d+\.\d\d +9\d\.\d\d +8\d\.\d\d +9\d\.\d\d  <-\n")
            # In degrees per second the same poles, and the gain of SI.
            degrees = [(t, u, y * 57.29577951308232) for t, u, y in motor(1200, 4)]
            other = made.write("degrees.csv", table(degrees, "t [s],voltage [V],speed [deg/s]"))
            again = result("model", other, *OF_MOTOR, "--for", "simulation")["black_box"]
            for a, b in zip(simulator["poles"], again["poles"]):
                self.assertAlmostEqual(a["real"], b["real"], delta=1e-6)
            self.assertAlmostEqual(simulator["gain"][0][0], again["gain"][0][0], delta=1e-6)

    def test_a_time_series_and_numbers_of_columns(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(900, 5)))
            series = result("model", log, "--output", "3", "--step", "10ms")
            self.assertEqual("prediction", series["black_box"]["purpose"])
            self.assertEqual([], series["filter"]["inputs"])

    def test_the_page_and_the_text_say_the_same(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(1200, 6)))
            text = run("model", log, *OF_MOTOR, "--report", made.path / "page.html", code=0).stdout
            self.assertIn("steady gain speed / voltage", text)
            self.assertIn("<-", text)
            self.assertIn("steady gain speed / voltage", (made.path / "page.html").read_text())

    def test_what_is_no_use_is_said_in_one_line(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(300, 7)))
            still = made.write("still.csv", table([(t, 1.0, y) for t, _, y in motor(300, 8)]))
            few = made.write("few.csv", table(motor(6, 9)))
            for message, *arguments in [
                ("--output is missing", log, "--input", "voltage"),
                ("named twice", log, "--input", "voltage", "--output", "voltage"),
                ("no column", log, "--input", "volts", "--output", "speed"),
                ("'voltage' never changes", still, *OF_MOTOR),
                ("too few", few, *OF_MOTOR),
                ("--order '0'", log, *OF_MOTOR, "--order", "0"),
                ("falls", log, *OF_MOTOR, "--order", "5:2"),
                ("--for simulation without --input", log, "--output", "speed", "--for", "simulation"),
            ]:
                done = run("model", *arguments, code=2)
                self.assertIn(message, done.stderr)
                self.assertEqual(1, done.stderr.count("\n"), done.stderr)

    def test_torture(self):
        """A model with its verdict or one line; never a hang, never an unstable model of stable data."""
        rows = motor(400, 10)
        with Folder() as made:
            for name, content in {
                "zeros": [(t, 0.0, 0.0) for t, _, _ in rows],
                "duplicated": [(t, y, y) for t, _, y in rows],
                "three": rows[:3],
                "below": rows[:15],
                "huge": [(t, 1e150 * u, 1e150 * y) for t, u, y in rows],
                "tiny": [(t, 1e-150 * u, 1e-150 * y) for t, u, y in rows],
                "step": [(t, float(t > 2.0), y) for t, _, y in rows],
                "ramp": [(t, u, 1000 * t) for t, u, _ in rows],
            }.items():
                done = run("model", made.write(name + ".csv", table(content)), *OF_MOTOR, "--json")
                self.assertIn(done.returncode, (0, 1, 2), f"{name}: {done.stderr}")
                self.assertNotIn("internal", done.stderr)
                if done.returncode < 2:
                    self.assertIsNotNone(json.loads(done.stdout)["filter"])

    def test_polynomials_of_a_known_system(self):
        """y = 0.5 q^-1 / (1 - 0.8 q^-1) u + e: output error, and ARMAX with C = A."""
        draw, x, rows = random.Random(8), 0.0, []
        for t in range(1500):
            u = draw.gauss(0, 1)
            rows.append((0.1 * t, u, x + 0.2 * draw.gauss(0, 1)))
            x = 0.8 * x + 0.5 * u
        with Folder() as made:
            log = made.write("log.csv", table(rows))
            for kind, poles in (("oe", "F"), ("armax", "A"), ("bj", "F")):
                found = result("model", log, *OF_MOTOR, "--as", kind, "--order", "1:3")
                self.assertEqual("ok", found["status"]["code"], kind)
                of = {each["name"]: each for each in found["black_box"]["polynomials"]}
                self.assertEqual((1, "voltage"), (of["B"]["delay"], of["B"]["input"]))
                for value, se, truth in ((of[poles]["value"][1], of[poles]["se"][1], -0.8), (of["B"]["value"][0], of["B"]["se"][0], 0.5)):
                    self.assertLess(abs(value - truth), 4.5 * se, kind)
                    self.assertLess(se, 0.03, kind)
            chosen = result("model", log, *OF_MOTOR, "--as", "oe", "--polynomials", "nb=1,nf=2", "--delay", "1")["black_box"]
            self.assertEqual([1, 3], [len(each["value"]) for each in chosen["polynomials"]])
            text = run("model", log, *OF_MOTOR, "--as", "oe", "--order", "1", "-o", made.path / "oe.yaml", code=0).stdout
            self.assertRegex(text, r"F of voltage: 1 - 0\.[78]\d* \+- 0\.0\d+ q\^-1")
            self.assertEqual("ok", result("check", made.path / "oe.yaml", log)["status"]["code"])

    def test_what_no_polynomials_can_be(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(300, 9)))
            for options, line in (
                    (("--polynomials", "na=1"), "--polynomials without --as; expected --as arx, armax, oe or bj"),
                    (("--delay", "1"), "--delay without --as; expected --as arx, armax, oe or bj"),
                    (("--as", "arx", "--polynomials", "nx=1"), "'nx=1' in --polynomials; expected na, nb, nc, nd or nf and a number up to 60: na=2,nb=3,nc=1"),
                    (("--as", "arx", "--polynomials", "na=1.5"), "'na=1.5' in --polynomials; expected na, nb, nc, nd or nf and a number up to 60: na=2,nb=3,nc=1"),
                    (("--as", "arx", "--polynomials", "nf=1"), "nf of --polynomials with --as arx; expected polynomials of that model: a, b"),
                    (("--as", "oe", "--polynomials", "nf=1"), "--polynomials nf=1 leaves nothing to estimate; expected at least one coefficient, and nb beside nf"),
                    (("--as", "oe", "--polynomials", "nb=1", "--order", "2"), "both --order and --polynomials; expected one of them"),
                    (("--as", "oe", "--delay", "-1"), "--delay '-1' is none; expected a number of rows from 0 to 100"),
                    (("--as", "oe", "--delay", "101"), "--delay '101' is none; expected a number of rows from 0 to 100"),
                    (("--steps", "5"), "--steps without --for control; expected how many rows a controller looks ahead"),
                    (("--for", "control", "--steps", "0"), "--steps '0' is none; expected a number of rows from 1 to 1000"),
                    (("--for", "control", "--steps", "200"), "held-out rows are too few for 200 rows ahead; expected longer recordings; a shorter --steps, or a larger --hold-out")):
                done = run("model", log, *OF_MOTOR, *options, code=2)
                self.assertEqual(f"identikal: {line}\n", done.stderr)
            done = run("model", log, "--output", "speed", "--as", "oe", code=2)
            self.assertIn("without an input", done.stderr)

    def test_its_page_draws_what_was_found(self):
        with Folder() as made:
            log = made.write("motor.csv", table(motor(800, 10)))
            page = made.path / "page.html"
            run("model", log, *OF_MOTOR, "--report", page, code=0)
            self.assertIn("showBlackBox", page.read_text())
            box = result("model", log, *OF_MOTOR)["black_box"]
            (step,), (frequency,) = box["step_responses"], box["frequency_responses"]
            self.assertLess(abs(step["value"][-1] - box["gain"][0][0]), 4 * step["se"][-1])
            self.assertAlmostEqual(314.159265, frequency["frequency"][-1], places=4)
            self.assertTrue(all(0 <= each <= 1 for each in frequency["coherence"]))

    def test_daisy(self):
        """Sets of others: first half estimates, order automatic, no anchor of anybody is in the program."""
        folder = SHARED / "benchmarks"
        if not folder.exists():
            self.skipTest("no benchmarks beside the repository")
        for name, inputs, outputs in (("dryer", "u1", "y1"), ("robot_arm", "u1", "y1"), ("thermic_res_wall", "u1,u2", "y1")):
            found = result_of_any("model", folder / f"daisy_{name}.csv", "--input", inputs, "--output", outputs)
            self.assertGreater(min(fit["fit_percent"] for fit in found["fit"]["simulation"].values()), 75)


def result_of_any(*arguments):
    done = run(*arguments, "--json")
    assert done.returncode in (0, 1), done.stderr
    return json.loads(done.stdout)


if __name__ == "__main__":
    unittest.main()
