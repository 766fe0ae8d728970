"""info: columns, units, channels."""
import pathlib
import unittest

from program import NILE, run, shared


class Info(unittest.TestCase):
    def test_every_recording(self):
        for path in sorted(pathlib.Path(shared("recordings")).glob("*")):
            if path.suffix in (".csv", ".txt"):
                self.assertIn("rows", run("info", path, code=0).stdout)

    def test_model_and_data(self):
        self.assertIn("level", run("info", *NILE, code=0).stdout)


if __name__ == "__main__":
    unittest.main(verbosity=2)
