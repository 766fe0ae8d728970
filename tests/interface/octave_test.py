"""Does the tracker of examples/ik_tune.c run from Octave? octave_test.py IDENTIKAL LIBRARY; 77 without Octave's compiler."""
import pathlib
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
if not shutil.which("mkoctfile") or not shutil.which("octave-cli"):
    sys.exit(77)
tool, library = pathlib.Path(sys.argv[1]).resolve(), pathlib.Path(sys.argv[2]).resolve()
model = ROOT / "examples/tracker.yaml"
with tempfile.TemporaryDirectory() as folder:
    subprocess.run(["mkoctfile", "--mex", f"-I{ROOT}/interface", str(ROOT / "examples/ik_tune.c"), f"-L{library.parent}",
                    "-lidentikal", f"-Wl,-rpath,{library.parent}"], cwd=folder, check=True)
    with open(f"{folder}/y.csv", "w") as data:
        subprocess.run([tool, "simulate", model, "--set", "q=0.09", "--set", "r=0.25", "-n", "500"], stdout=data, check=True)
    program = """y = dlmread('y.csv', ',', %d, 0);
result = jsondecode(ik_tune(fileread('%s'), y(:, 1)));
printf('%%.12g %%.12g\\n', result.parameters(1).value, result.parameters(2).value);
try, ik_tune('identikal: 2', y), catch e, disp(e.message), end"""
    lines = pathlib.Path(folder, "y.csv").read_text().splitlines()
    header = next(i for i, line in enumerate(lines) if not line.startswith("#"))
    said = subprocess.run(["octave-cli", "--eval", program % (header + 1, model)], cwd=folder, check=True, capture_output=True,
                          text=True).stdout.splitlines()
    told = subprocess.run([tool, "tune", model, "y.csv", "--json"], cwd=folder, check=True, capture_output=True, text=True).stdout
    import json
    values = [p["value"] for p in json.loads(told)["parameters"]]
    assert [float(v) for v in said[0].split()] == [float(f"{v:.12g}") for v in values], (said, values)
    assert "<model>:1:12: identikal is" in said[1], said
print("Octave and the command line agree:", said)
