"""Recordings in several files; channels with scale, offset and delay."""
import csv
import pathlib
import unittest

from program import LANE_CHANGE, VEHICLE, Folder, result, run


class Treated(unittest.TestCase):
    """Several files of one recording, and channels with scale, offset and delay: the same car comes out."""

    def setUp(self):
        self.folder = Folder()
        self.folder.__enter__()
        self.addCleanup(self.folder.__exit__, None, None, None)
        with open(LANE_CHANGE[1], newline="") as file:
            lines = [line for line in csv.reader(file) if line and not line[0].startswith("#")]
        self.names = [name.split(" [")[0] for name in lines[0]]
        self.rows = [dict(zip(self.names, map(float, row))) for row in lines[1:]]
        self.plain = self.fitted(VEHICLE, LANE_CHANGE[1])

    def fitted(self, model, data):
        out = result("fit", self.folder.write("car.yaml", model), data)
        return {p["name"]: p for p in out["parameters"]}, out

    def write(self, name, columns, rows):
        text = ",".join(columns) + "\n" + "".join(
            ",".join("" if row[c] is None else f"{row[c]:.9g}" for c in columns) + "\n" for row in rows)
        return self.folder.write(name, text)

    def same_car(self, parameters, errors):
        for name in ("Cf", "Cr", "Iz"):
            one, other = self.plain[0][name], parameters[name]
            self.assertLess(abs(one["value"] - other["value"]), errors * one["se"], name)

    def test_joined_files(self):
        imu = self.write("imu.csv", ["t", "yaw_rate", "vy"], self.rows)
        late = [dict(row, t=row["t"] + 0.003) for row in self.rows]
        can = self.write("can.csv", ["t", "swa", "speed"], late)
        # The signals are as before, 3 ms apart: interpolated, not copied.
        shifted = VEHICLE.replace("column: swa, unit: deg", "column: swa, unit: deg, delay: 3 ms")
        parameters, out = self.fitted(shifted, imu + "+" + can)
        self.same_car(parameters, 0.5)
        self.assertEqual([imu, can], [i["path"] for i in out["inputs"]])
        notes = " ".join(w["text"] for w in out["warnings"] if w["code"] == "data_treated")
        self.assertIn("swa, speed interpolated linearly from can.csv", notes)
        self.assertIn("steering_wheel_angle is column 'swa' 0.003 s earlier", notes)
        text = run("fit", self.folder.path / "car.yaml", imu + "+" + can, code=0).stdout
        self.assertIn("rows and times are those of imu.csv", " ".join(text.split()))

    def test_scale_offset_and_delay(self):
        step = self.rows[1]["t"] - self.rows[0]["t"]
        late = round(0.3 / step)
        rows = [dict(row, swa=self.rows[i - late]["swa"] if i >= late else None, yaw_rate=-row["yaw_rate"],
                     vy=2 * (row["vy"] - 0.2)) for i, row in enumerate(self.rows)]
        data = self.write("late.csv", self.names, rows)
        model = VEHICLE.replace("column: swa, unit: deg", f"column: swa, unit: deg, delay: {late * step} s")
        model = model.replace("column: yaw_rate, unit: deg/s", "column: yaw_rate, unit: deg/s, scale: -1")
        model = model.replace("column: vy, unit: m/s", "column: vy, unit: m/s, scale: 0.5, offset: 20 cm/s")
        self.same_car(self.fitted(model, data)[0], 0.5)

    def test_round_trip(self):
        model = VEHICLE.replace("column: swa, unit: deg", "column: swa, unit: deg, delay: 0.2 s, scale: -1")
        model = self.folder.write("turned.yaml", model)
        data = self.folder.write("turned.csv", run("simulate", model, "--rate", "100", code=0).stdout)
        parameters = {p["name"]: p for p in result("fit", model, data)["parameters"]}
        self.assertAlmostEqual(parameters["Cf"]["value"], 8e4, delta=4 * parameters["Cf"]["se"])

    def test_without_the_keys_nothing_changes(self):
        out = self.plain[1]
        self.assertNotIn("data_treated", [w["code"] for w in out["warnings"]])

    def test_plus_in_a_name(self):
        self.folder.write("a+b.csv", pathlib.Path(LANE_CHANGE[1]).read_bytes())
        self.same_car(self.fitted(VEHICLE, str(self.folder.path / "a+b.csv"))[0], 1e-9)


if __name__ == "__main__":
    unittest.main(verbosity=2)
