"""info: columns, units, channels."""
import pathlib
import tempfile
import unittest

from program import NILE, Folder, run, shared


class Info(unittest.TestCase):
    def test_every_recording(self):
        for path in sorted(pathlib.Path(shared("recordings")).glob("*")):
            if path.suffix in (".csv", ".txt"):
                self.assertIn("rows", run("info", path, code=0).stdout)

    def test_epoch_in_nanoseconds(self):
        """Doubles hold every 256th of them; the step is 0.1 ms."""
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "log.csv")
            path.write_text("time [ns],y\n" + "".join(f"{1700000000123456789 + k * 100000},{k % 7}\n" for k in range(200)))
            self.assertIn("10000 Hz (step 0.0001 s), 0.0199 s long, 0 gaps, 0 uneven", run("info", path, code=0).stdout)

    def test_dates_are_times(self):
        with Folder() as made:
            log = made.write("log.csv", "when;y\n" + "".join(f"31.01.2024 23:{k:02}:00,5;{k % 7}\n" for k in range(60)))
            found = run("info", log, code=0).stdout
            self.assertIn("'when': 0.0166667 Hz (step 60 s), 3540 s long, 0 gaps, 0 uneven", found)
            self.assertIn("2024-01-31 23:00:00.5 to 2024-01-31 23:59:00.5", found)
            log = made.write("months.csv", "month,y\n" + "".join(f"{1949 + k // 12}-{k % 12 + 1:02},{k % 7}\n" for k in range(60)))
            self.assertIn("months from 1949-01-01 on", run("info", log, code=0).stdout)

    def test_numbers_with_blanks_between(self):
        with Folder() as made:
            log = made.write("log.dat", "# t  speed [km/h]\n" + "".join(f"  {k / 10:.1f}   {k % 7}.5\n" for k in range(60)))
            found = run("info", log, code=0).stdout
            self.assertIn("rows   60, columns 2, separated by blanks", found)
            self.assertIn("'t': 10 Hz", found)

    def test_epoch_without_a_unit(self):
        with tempfile.TemporaryDirectory() as folder:
            path = pathlib.Path(folder, "log.csv")
            for digits in (3, 6, 9):
                path.write_text("timestamp,y\n" + "".join(f"{(17000000000 + k) * 10 ** (digits - 1)},{k % 7}\n" for k in range(200)))
                self.assertIn("10 Hz (step 0.1 s), 19.9 s long, 0 gaps, 0 uneven", run("info", path, code=0).stdout)

    def test_model_and_data(self):
        self.assertIn("level", run("info", *NILE, code=0).stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
