"""fit: vehicles."""
import pathlib
import unittest

from program import LANE_CHANGE, Folder, result, run


class Fit(unittest.TestCase):
    def test_the_cause_goes_first(self):
        """A channel with the wrong sign makes all that follows: it is named first, its consequences in one note."""
        text = pathlib.Path(LANE_CHANGE[0]).read_text()
        with Folder() as folder:
            for column in ("column: yaw_rate, unit: deg/s", "column: swa, unit: deg"):
                model = folder.write("m.yaml", text.replace(column, column + ", scale: -1"))
                out = result("fit", model, LANE_CHANGE[1], code=1)
                self.assertEqual("untrusted", out["status"]["code"])
                self.assertTrue(out["status"]["message"].startswith("do not use these values: sign_"), out["status"]["message"])
                codes = [w["code"] for w in out["warnings"]]
                self.assertTrue(codes[0].startswith("sign_"), codes)
                self.assertIn("consequences", codes)
                for code in ("at_bound", "poor_fit", "noise_differs", "implausible_Cf"):
                    self.assertNotIn(code, codes)
                note = out["warnings"][codes.index("consequences")]
                self.assertEqual("note", note["severity"])
                self.assertIn("at_bound", note["text"])
                self.assertTrue(all(w["code"].startswith("sign_") for w in out["warnings"] if w["severity"] == "serious"), codes)

    def test_circles_do_not_determine_the_inertia(self):
        """Whether the search ends on a bound there or not is chance: the answer is the same."""
        with Folder() as folder:
            ends = set()
            for duration, method in ((20, "output-error"), (30, "output-error"), (40, "output-error"), (40, "prediction-error")):
                run("simulate", LANE_CHANGE[0], "--manoeuvre", "steady-circle", "--duration", f"{duration}s", "-o", folder.path, code=0)
                out = result("fit", LANE_CHANGE[0], folder.path / "simulated.csv", "--method", method, code=1)
                Iz = next(p for p in out["parameters"] if p["name"] == "Iz")
                ends.add(Iz["value"] in Iz["bounds"])
                self.assertEqual(("rejected", "this recording does not determine Iz separately"), (out["status"]["code"], out["status"]["message"]))
                self.assertEqual("poorly_determined", Iz["verdict"])
                self.assertLess(Iz["ci95"][0], 0)
                self.assertEqual([], [w["code"] for w in out["warnings"] if w["severity"] == "serious" or w["code"] == "implausible_Iz"])
            self.assertEqual({True, False}, ends)

    def test_severe_lane_change(self):
        out = result("fit", *LANE_CHANGE)
        for p in out["parameters"]:
            if p["name"] in ("Cf", "Cr", "Iz"):
                truth = {"Cf": 88107.7, "Cr": 88107.7, "Iz": 2319}[p["name"]]
                print(f"{p['name']} {p['value']:.1f} +- {p['se']:.1f}, bound {p['crb_se']:.1f}, truth {truth}")
                self.assertLess(abs(p["value"] - truth), 3 * p["se"])

    def test_shipped_data_are_what_simulate_makes(self):
        made = run("simulate", LANE_CHANGE[0], "--rate", "10 Hz", "--seed", 2010, "--set", "Cf=88107.7", "--set", "Cr=88107.7",
                   "--set", "Iz=2319", code=0).stdout
        self.assertEqual(made, pathlib.Path(LANE_CHANGE[1]).read_text())


if __name__ == "__main__":
    unittest.main(verbosity=2)
