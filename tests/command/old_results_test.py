"""Results that version 1 of the schema has written."""
import json
import shutil
import unittest

import jsonschema

from program import LANE_CHANGE, NILE, ROOT, SCHEMA, Folder, result, run


class TestResultsOfVersion1(unittest.TestCase):
    """Results that version 1 of the schema holds, as the program wrote them then, are read."""

    def setUp(self):
        self.folder = Folder().__enter__()
        self.old = self.folder.path / "old"
        shutil.copytree(ROOT / "tests/golden/result_v1", self.old)

    def tearDown(self):
        self.folder.__exit__()

    def test_report_has_the_new_names_and_the_old_keys(self):
        for name, code, verdict in (("nile", "ok", "poorly_determined"), ("check", "rejected", "ok"), ("lane_change", "ok", "ok")):
            run("report", self.old / name, code=0)
            page = (self.old / name / "report.html").read_text()
            read = lambda block: json.loads(page.split(f'id="{block}">')[1].split("</script>")[0])
            out, data = read("result"), read("data")
            jsonschema.validate(out, SCHEMA)
            self.assertEqual((2, code, verdict), (out["schema_version"], out["status"]["code"], out["parameters"][0]["verdict"]))
            self.assertEqual(out["objective"]["starts_agree"], out["objective"]["starts_at_optimum"])
            self.assertEqual(out["noise"]["expected_loss"], out["noise"]["excess_mean_square_error"])
            self.assertIn("simulation", data["channels"][0])
            self.assertNotIn("free_run", data["channels"][0])
            before = json.loads((self.old / name / "result.json").read_text())
            self.assertEqual([p["value"] for p in before["parameters"]], [p["value"] for p in out["parameters"]])

    def test_other_verbs(self):
        now = self.folder.path / "now"
        run("tune", *NILE, "-o", now, code=0)
        self.assertIn("q = 1469.18, se 1.28e+03, poorly determined", run("export", self.old / "nile", "--to", "python", code=0).stdout)
        self.assertIn("REJECTED: not optimal", run("export", self.old / "check", "--to", "c", code=0).stdout)
        self.assertEqual("rejected", json.loads(run("export", self.old / "check", "--to", "json", code=0).stdout)["status"]["code"])
        old, new = (json.loads(run("validate", r, NILE[1], "--json").stdout) for r in (self.old / "nile", now))
        # The earlier search ended 5e-8 from the maximum (NoiseMl.NileToTenDigits has its digits).
        for a, b in zip(old["tests"], new["tests"], strict=True):
            self.assertEqual((a["id"], a["pass"]), (b["id"], b["pass"]))
            self.assertAlmostEqual(a["value"], b["value"], delta=5e-8 * abs(b["value"]) + 1e-12)
        # Likelihoods of diffuse starts compare behind their first samples, of which version 1 says nothing.
        refused = run("compare", self.old / "nile", now, code=2).stderr
        self.assertIn("which determine a diffuse start; expected results of this version", refused)
        self.assertIn("Cf", run("validate", self.old / "lane_change", LANE_CHANGE[1]).stdout)


class TestResultsOfEarlierPrograms(unittest.TestCase):
    """A program of the same schema that wrote less: what it did not say is nothing known, no reason to refuse its results."""

    LATER = {"": ("handling", "forecast", "black_box", "driven", "references"),
             "objective": ("diffuse_samples", "leading", "bic_values", "rows", "integration_step"),
             "parameters": ("se_structure", "prior"), "tests": ("share",), "warnings": ("changes",)}

    def without_later_keys(self, stored):
        document = json.loads(stored.read_text())
        for place, keys in self.LATER.items():
            at = document[place] if place else document
            for one in at if isinstance(at, list) else [at]:
                for key in keys:
                    one.pop(key, None)
        return json.dumps(document)

    def test_are_read(self):
        with Folder() as folder:
            for job, data in ((("tune", *NILE), NILE[1]), (("fit", *LANE_CHANGE), LANE_CHANGE[1])):
                now = folder.path / job[0]
                run(*job, "-o", now, code=0)
                before = folder.path / f"{job[0]}_before"
                before.mkdir()
                (before / "result.json").write_text(self.without_later_keys(now / "result.json"))
                exported = [json.loads(run("export", one, "--to", "json", code=0).stdout) for one in (before, now)]
                self.assertEqual(exported[0].get("parameters"), exported[1].get("parameters"))
                validated = [json.loads(run("validate", one, data, "--json").stdout) for one in (before, now)]
                self.assertEqual(validated[0]["tests"], validated[1]["tests"])


if __name__ == "__main__":
    unittest.main(verbosity=2)
