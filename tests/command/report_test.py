"""The page and the files of a result."""
import csv
import json
import os
import random
import unittest

from program import LANE_CHANGE, NILE, ROOT, SYSTEM_1, Folder, result, run


class Report(unittest.TestCase):
    def test_report(self):
        with Folder() as folder:
            page, out = folder.path / "pages" / "nile.html", folder.path / "out"
            run("tune", *NILE, "-o", out, "--report", page, code=0)
            self.assertEqual(["report_data.json", "residuals.csv", "result.json"], sorted(os.listdir(out)))
            text = page.read_text()
            self.assertLess(len(text), 1_000_000)
            for words in ("function timePlots", "sha256", "identikal tune"):
                self.assertIn(words, text)
            printed = run("report", out, code=0).stdout
            self.assertEqual(f"{out / 'report.html'} written\n", printed)
            self.assertEqual(text, (out / "report.html").read_text())
            again = folder.path / "again.html"
            run("report", out / "result.json", "--report", again, code=0)
            self.assertEqual(text, again.read_text())

    def test_a_result_holds_what_is_printed(self):
        with Folder() as folder:
            out = folder.path / "out"
            run("fit", *LANE_CHANGE, "-o", folder.path / "car", code=0)
            for words, job in (("autocovariances", ("tune", *NILE, "--method", "als")), ("rms", ("fit", *LANE_CHANGE)),
                               ("refit on these data", ("validate", folder.path / "car", LANE_CHANGE[1])),
                               ("log-likelihood", ("compare", folder.path / "car", folder.path / "car"))):
                notes = json.loads(run(*job, "--json").stdout)["notes"]
                self.assertGreater(len(notes), 0, job)
                printed = run(*job).stdout
                for line in notes:
                    self.assertIn(" ".join(line.split()), " ".join(printed.split()), job)
                self.assertIn(words, "\n".join(notes))
            run("tune", *NILE, "--method", "als", "-o", out, code=0)
            stored = json.loads((out / "result.json").read_text())
            self.assertIn("autocovariances of the innovations", stored["notes"][0])
            run("report", out, code=0)
            self.assertIn("result.notes", (out / "report.html").read_text())

    def test_report_data(self):
        def strict(text):
            return json.loads(text, parse_constant=self.fail)

        with Folder() as folder:
            run("tune", *NILE, "--starts", 5, "-o", folder.path / "a", code=0)
            data = strict((folder.path / "a/report_data.json").read_text())
            self.assertEqual(100, len(data["time"]))
            self.assertNotIn("hi", data["channels"][0]["measured"])
            volume = [float(row["volume"]) for row in csv.DictReader((ROOT / "data/nile.csv").read_text().splitlines())]
            self.assertEqual(volume, data["channels"][0]["measured"]["y"])
            self.assertEqual([None] * 70, data["channels"][0]["simulation"]["y"][:70])
            # A local level stays where the last filtered one was.
            self.assertEqual(1, len(set(data["channels"][0]["simulation"]["y"][70:])))
            self.assertEqual(5, len(data["searches"]))
            self.assertEqual(["q", "r"], [p["name"] for p in data["profiles"]])
            for profile, limits in zip(data["profiles"], ((252.47, 5984.9), (9618.8, 22123))):
                # The curve passes the 95 % limit where the profile interval ends.
                at = [i for i in range(len(profile["drop"]) - 1)
                      if (profile["drop"][i] > 3.8415) != (profile["drop"][i + 1] > 3.8415)]
                self.assertEqual(2, len(at))
                for i, limit in zip(at, limits):
                    self.assertLess(profile["value"][i], limit)
                    self.assertGreater(profile["value"][i + 1], limit)
            # Thinned to the least and the largest of every column: against the rows themselves.
            random.seed(4)
            rows = [random.gauss(0, 1) for _ in range(20011)]
            rows[12345] = 50.0
            long = folder.write("long.csv", "y\n" + "".join(f"{v:.6f}\n" for v in rows))
            run("check", folder.write("model.yaml", SYSTEM_1), long, "-o", folder.path / "b")
            data = strict((folder.path / "b/report_data.json").read_text())
            self.assertEqual(20011, data["rows"])
            each = -(-20011 // data["columns"])
            line = data["channels"][0]["measured"]
            for k in range(data["columns"]):
                self.assertAlmostEqual(min(rows[k * each:(k + 1) * each]), line["lo"][k], delta=0.005)
                self.assertAlmostEqual(max(rows[k * each:(k + 1) * each]), line["hi"][k], delta=0.005)
            self.assertEqual(1, sum(v > 49 for v in line["hi"]))

    def test_report_of_a_vehicle(self):
        with Folder() as folder:
            out = result("fit", *LANE_CHANGE, "--hold-out", "30%", "-o", folder.path)
            data = json.loads((folder.path / "report_data.json").read_text())
            self.assertEqual(["front", "rear"], [a["name"] for a in data["axles"]])
            for axle, name in zip(data["axles"], ("Cf", "Cr")):
                C = next(p["value"] for p in out["parameters"] if p["name"] == name)
                self.assertAlmostEqual(C * axle["curve_slip"][-1], axle["curve_force"][-1], delta=2e-3 * C * axle["curve_slip"][-1])
            self.assertEqual({"simulated", "measured"}, {t["name"] for t in data["tracks"]})
            self.assertAlmostEqual(data["time"][49], data["held_from"])
            self.assertEqual(70, data["rows"])
            self.assertEqual([p["name"] for p in out["parameters"] if not p["fixed"]], [p["name"] for p in data["profiles"]])

    def test_reports_of_other_verbs(self):
        with Folder() as folder:
            regression = str(ROOT / "examples/yaw_rate_regression.yaml"), LANE_CHANGE[1]
            for verb, files in (("check", NILE), ("track", NILE), ("track", regression), ("track", LANE_CHANGE), ("shape", NILE)):
                self.assertIn(run(verb, *files, "--report", folder.path / "page.html").returncode, (0, 1, 3))
                page = (folder.path / "page.html").read_text()
                data = json.loads(page.split('id="data">')[1].split("</script>")[0])
                self.assertEqual(verb == "track", len(data["time_history"]) > 0)


if __name__ == "__main__":
    unittest.main(verbosity=2)
