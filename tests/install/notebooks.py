"""docs/notebooks executed by Jupyter: notebooks.py; python3-nbconvert and python3-ipykernel of Debian."""
import importlib.util
import pathlib
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
if not all(importlib.util.find_spec(name) for name in ("nbconvert", "ipykernel")):
    print("nbconvert or ipykernel is missing")
    sys.exit(77)
with tempfile.TemporaryDirectory() as folder:
    for notebook in sorted((ROOT / "docs/notebooks").glob("*.ipynb")):
        subprocess.run([sys.executable, "-m", "nbconvert", "--to", "html", "--execute", "--output-dir", folder, notebook], check=True, capture_output=True)
        print(notebook.name, "ran")
