"""info --vehicle: surveys."""
import pathlib
import unittest

from program import LANE_CHANGE, SHARED, Folder, result, run, shared


class Vehicle(unittest.TestCase):
    """info --vehicle: what is wrong with a recording before any fit."""

    def surveyed(self, *arguments):
        return result("info", "--vehicle", *arguments)["survey"]

    def codes(self, survey):
        return {w["code"] for w in survey["findings"]}

    def test_clean(self):
        for arguments in ((LANE_CHANGE[1],), LANE_CHANGE):
            survey = self.surveyed(*arguments)
            self.assertEqual(set(), self.codes(survey))
            self.assertEqual("yes", {v["of"]: v["answer"] for v in survey["identifiable"]}["Iz"])
            self.assertIn("no faults found", run("info", "--vehicle", *arguments, code=0).stdout)

    def test_recordings(self):
        names = ["recordings/comma2k19_rav4_imu.csv", "recordings/comma2k19_rav4_speed.csv",
                 "recordings/comma2k19_rav4_steer.csv"]
        survey = self.surveyed("+".join(shared(name) for name in names))
        self.assertIn("several_clocks", self.codes(survey))
        self.assertEqual("no", {v["of"]: v["answer"] for v in survey["identifiable"]}["steering_ratio"])
        survey = self.surveyed(shared("recordings/revsted_obd_sample.csv"))
        self.assertLessEqual({"sign_ay", "held_samples"}, self.codes(survey))
        for path in sorted((SHARED / "recordings").glob("*.[ct][sx][vt]")):
            text = run("info", "--vehicle", path, code=0).stdout
            self.assertLessEqual(max(map(len, text.splitlines()[1:])), 80, path)

    def test_the_mapping_proposed_is_a_model(self):
        data = shared("recordings/polaris_human_connor_track3_1.csv")
        text = run("info", "--vehicle", data, code=0).stdout.split("no file is changed):\n")[1]
        with Folder() as folder:
            model = folder.write("proposed.yaml", "identikal: 1\nparameters: {m: 900 kg, a: 1 m, b: 1 m, "
                                 "Iz: 700 kg m^2, Cf: 3e4 N/rad, Cr: 3e4 N/rad, steering_ratio: 15}\n" + text)
            survey = self.surveyed(model, data)
            self.assertEqual(set(), {w["code"] for w in survey["findings"] if w["severity"] == "serious"})

    def test_the_model_proposed_is_whole_but_for_what_no_recording_tells(self):
        with Folder() as folder:
            text = run("info", "--vehicle", "--model", LANE_CHANGE[1], code=0).stdout
            asked = run("fit", folder.write("car.yaml", text), LANE_CHANGE[1], code=2).stderr
            self.assertRegex(asked, r"car.yaml:6:3: 'm' in parameters has no value")
            for line, value in (("m:", "1446 kg"), ("a:", "0.987 m"), ("b:", "1.525 m"), ("steering_ratio:", "21")):
                text = text.replace(f"  {line} ", f"  {line} {value} ")
            found = result("fit", folder.write("whole.yaml", text), LANE_CHANGE[1])
            as_written = {p["name"]: p["value"] for p in result("fit", *LANE_CHANGE)["parameters"]}
            for p in found["parameters"]:
                if not p["fixed"]:
                    self.assertAlmostEqual(p["value"] / as_written[p["name"]], 1.0, delta=0.02)
        for wrong in (["--model", LANE_CHANGE[1]], ["--vehicle", "--model", *LANE_CHANGE],
                      ["--vehicle", "--model", "--json", LANE_CHANGE[1]],
                      ["--vehicle", "--model", LANE_CHANGE[1], LANE_CHANGE[1]]):
            self.assertIn("--model", run("info", *wrong, code=2).stderr)

    def test_a_sign_that_the_model_turns_is_turned_back(self):
        """What is proposed in place of a scale of -1 is what fit finds the car with."""
        text = pathlib.Path(LANE_CHANGE[0]).read_text()
        for column, unit in (("yaw_rate", "deg/s"), ("swa", "deg")):
            with self.subTest(column), Folder() as folder:
                turned = text.replace(f"column: {column}, unit: {unit}", f"column: {column}, unit: {unit}, scale: -1")
                self.assertNotEqual(text, turned)
                model = folder.write("turned.yaml", turned)
                survey = self.surveyed(model, LANE_CHANGE[1])
                self.assertEqual({"sign_steering"}, self.codes(survey))
                self.assertIn("leave out the scale: -1 of", survey["findings"][0]["remedy"])
                proposed = run("info", "--vehicle", model, LANE_CHANGE[1], code=0).stdout.split("no file is changed):\n")[1]
                self.assertNotIn("scale", proposed)
                head = text[:text.index("inputs:")].replace("time: {column: t, unit: s}\n", "").replace("model: single-track\n", "")
                found = result("fit", folder.write("proposed.yaml", head + proposed), LANE_CHANGE[1])
                for p, q in zip(found["parameters"], result("fit", *LANE_CHANGE)["parameters"], strict=True):
                    self.assertAlmostEqual(p["value"], q["value"], delta=0.02 * abs(q["value"]) + 1e-9, msg=p["name"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
