"""handling: the engineer's sheet."""
import pathlib
import re
import unittest

from program import LANE_CHANGE, NILE, SYSTEM_1, VEHICLE, Folder, result, run

TRUTH = "Cf=88107.7", "Cr=88107.7", "Iz=2319"


def simulated(folder, name, manoeuvre, *settings):
    """A recording of the lane change's car in another manoeuvre, without noise."""
    truth = [word for value in TRUTH for word in ("--set", value)]
    run("simulate", LANE_CHANGE[0], "--manoeuvre", manoeuvre, *truth, *settings, "-o", folder / name, code=0)
    return folder / name / "simulated.csv"


def lines_of(path):
    """Heading and rows, without the comments above."""
    return [line for line in path.read_text().splitlines() if not line.startswith("#")]


def figures(sheet):
    return {f["name"]: f for section in sheet["handling"]["sections"] for f in section["figures"]}


def printed(text):
    """What a person reads, but for the names of the files."""
    return [line for line in text.splitlines() if not line.startswith("data ")]


class Handling(unittest.TestCase):
    def fitted(self, folder):
        run("fit", *LANE_CHANGE, "-o", folder / "fit", code=0)
        return folder / "fit"

    def test_result_and_log(self):
        with Folder() as folder:
            fit = self.fitted(folder.path)
            told = result("fit", *LANE_CHANGE)
            sheet = result("handling", fit, LANE_CHANGE[1])
            every = figures(sheet)
            derived = {d["name"]: d for d in told["derived"]}
            for name, key in (("understeer gradient K", "K per g"), ("characteristic speed", "v_ch")):
                self.assertAlmostEqual(every[name]["model"]["value"], derived[key]["value"], 6)
                self.assertGreaterEqual(every[name]["model"]["se"] * (1 + 1e-9), derived[key]["se"])
            self.assertEqual("handling", sheet["verb"])
            self.assertAlmostEqual(60, every["entry speed"]["log"]["value"], 1)
            for name in ("peak of r", "peak of beta"):
                log, model = every[name]["log"], every[name]["model"]
                self.assertLess(abs(log["value"] - model["value"]), 3 * (log["se"] ** 2 + model["se"] ** 2) ** 0.5, name)
            self.assertIsNone(every["peak of ay"]["log"]["value"])
            self.assertEqual("The log has no lateral acceleration.", every["peak of ay"]["log"]["why"])
            text = run("handling", fit, LANE_CHANGE[1], code=0).stdout
            self.assertLessEqual(max(map(len, text.splitlines())), 80)
            for mark in re.findall(r"\[(\d)\]", text):
                self.assertIn(f"  [{mark}] ", text)

    def test_without_a_log(self):
        sheet = result("handling", LANE_CHANGE[0], "--speed", "100 km/h")
        self.assertAlmostEqual(100 / 3.6, sheet["handling"]["speed"])
        every = figures(sheet)
        self.assertEqual("No recording was given.", every["understeer gradient K"]["log"]["why"])
        self.assertIn("no errors", every["understeer gradient K"]["model"]["why"])
        self.assertIsNone(every["damping"]["model"]["se"])

    def test_beyond_the_fit(self):
        with Folder() as folder:
            fit = self.fitted(folder.path)
            sweep = simulated(folder.path, "sweep", "sweep")
            remarks = " ".join(result("handling", fit, sweep)["handling"]["remarks"])
            self.assertIn("100 % of the log's rows lie outside what the model was fitted to (vx 16.7 to 16.7 m/s", remarks)
            self.assertIn("The model's response is that at 27.8 m/s, beyond vx 16.7 to 16.7 m/s", remarks)

    def test_units_of_columns(self):
        """Radians and metres per second for degrees and km/h: the same page."""
        with Folder() as folder:
            log = simulated(folder.path, "sweep", "sweep")
            header, *rows = lines_of(log)
            names = header.split(",")
            factor = [{"swa": 3.141592653589793 / 180, "yaw_rate": 3.141592653589793 / 180, "speed": 1 / 3.6}.get(n.split()[0].split("[")[0], 1) for n in names]
            self.assertEqual(3, sum(f != 1 for f in factor), header)
            units = {"deg]": "rad]", "deg/s]": "rad/s]", "km/h]": "m/s]"}
            other = re.sub("|".join(map(re.escape, units)), lambda m: units[m[0]], header)
            body = [",".join(repr(float(c) * f) for c, f in zip(row.split(","), factor)) for row in rows]
            other_log = folder.write("si.csv", "\n".join([other, *body]) + "\n")
            model = (pathlib.Path(LANE_CHANGE[0]).read_text().replace("swa, unit: deg", "swa, unit: rad").replace("speed, unit: km/h", "speed, unit: m/s")
                     .replace("yaw_rate, unit: deg/s", "yaw_rate, unit: rad/s"))
            si = folder.write("si.yaml", model)
            self.assertEqual(printed(run("handling", LANE_CHANGE[0], log, code=0).stdout), printed(run("handling", si, other_log, code=0).stdout))

    def test_two_files_are_one_log(self):
        """Manoeuvres one after the other in one file, with a pause, or a file each."""
        with Folder() as folder:
            first = lines_of(simulated(folder.path, "sweep", "sweep"))
            second = lines_of(simulated(folder.path, "step", "step-steer"))
            self.assertEqual(first[0], second[0])
            later = [f"{float(row.split(',', 1)[0]) + 100:.10g},{row.split(',', 1)[1]}" for row in second[1:]]
            both = folder.write("both.csv", "\n".join(first + later) + "\n")
            apart = folder.write("first.csv", "\n".join(first) + "\n"), folder.write("second.csv", "\n".join(second[:1] + later) + "\n")
            whole = run("handling", LANE_CHANGE[0], both, code=0).stdout
            split = run("handling", LANE_CHANGE[0], *apart, code=0).stdout
            strip = lambda text: [line for line in printed(text) if "rows used" not in line]
            self.assertEqual(strip(whole), strip(split))

    def test_refuses(self):
        with Folder() as folder:
            tuned = folder.path / "tuned"
            run("tune", *NILE, "-o", tuned, code=0)
            linear = folder.write("linear.yaml", SYSTEM_1)
            text = pathlib.Path(LANE_CHANGE[1]).read_text()
            short = folder.write("short.csv", "\n".join([line for line in text.splitlines() if line[0] != "#"][:6]) + "\n")
            no_steering = folder.write("no_steering.csv", text.replace("swa", "handle"))
            for arguments, said in (
                    ((tuned, LANE_CHANGE[1]), "a result of 'tune'; expected a result of fit about a vehicle"),
                    ((linear, LANE_CHANGE[1]), "a model that is no vehicle; expected model: single-track"),
                    ((LANE_CHANGE[1],), "a recording where a result or a model file is expected"),
                    ((LANE_CHANGE[0], no_steering), "swa"),
                    ((LANE_CHANGE[0], short), "no usable"),
                    ((LANE_CHANGE[0], "--speed", "0 km/h"), "is not above 0"),
                    ((LANE_CHANGE[0], "--range", "1s:2s"), "--range does not apply without a recording"),
                    ((), "FILES is missing")):
                done = run("handling", *arguments, code=2)
                self.assertIn(said, done.stderr, arguments)
                self.assertEqual(1, len(done.stderr.splitlines()), done.stderr)

    def test_flipped_sign(self):
        with Folder() as folder:
            upside_down = re.sub("yaw_rate, unit: deg/s", "yaw_rate, unit: deg/s, scale: -1", pathlib.Path(LANE_CHANGE[0]).read_text())
            done = run("handling", folder.write("upside_down.yaml", upside_down), LANE_CHANGE[1])
            self.assertIn("sign_steering", done.stdout)

    def test_doubtful_result(self):
        with Folder() as folder:
            upside_down = re.sub("yaw_rate, unit: deg/s", "yaw_rate, unit: deg/s, scale: -1", pathlib.Path(LANE_CHANGE[0]).read_text())
            model = folder.write("upside_down.yaml", upside_down)
            run("fit", model, LANE_CHANGE[1], "-o", folder.path / "fit", code=1)
            sheet = result("handling", folder.path / "fit", LANE_CHANGE[1])
            self.assertIn("doubtful_result", {w["code"] for w in sheet["warnings"]})


if __name__ == "__main__":
    unittest.main(verbosity=2)
