"""pip install without network and a wheel, each in an environment of its own that sees Debian's numpy."""
import os
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
NILE = ("import numpy, identikal as ik; y = numpy.loadtxt('data/nile.csv', delimiter=',', skiprows=1)[:, -1]; "
        "print(round(ik.tune('examples/nile.yaml', y).log_likelihood, 4))")

with tempfile.TemporaryDirectory() as folder:
    source, place = pathlib.Path(folder, "source"), pathlib.Path(folder, "place")
    subprocess.run(["git", "clone", "-q", ROOT, source], check=True)
    subprocess.run([sys.executable, "-m", "venv", "--system-site-packages", place], check=True)
    python = place / "bin/python"
    environment = {**os.environ, "IDENTIKAL_BUILD": str(pathlib.Path(folder, "build"))}
    for command in (["install", "--no-index", "--no-build-isolation", "."],
                    ["wheel", "--no-index", "--no-build-isolation", "--no-deps", "-w", folder, "."]):
        subprocess.run([python, "-m", "pip", "-q", *command], cwd=source, env=environment, check=True)
    said = subprocess.run([python, "-c", NILE], cwd=source, capture_output=True, text=True, check=True).stdout.strip()
    assert said == "-632.5456", said
    tool = subprocess.run([python, "-m", "identikal", "--version"], cwd=source, capture_output=True, text=True, check=True)
    assert tool.stdout.startswith("identikal"), tool.stdout
    assert list(pathlib.Path(folder).glob("identikal-*.whl"))
print("pip install and pip wheel work without network")
