"""The package for Python under AddressSanitizer and UndefinedBehaviorSanitizer: its tests but the long ones, and many random calls.

python_sanitized.py BUILD [CALLS]: goes on with BUILD, or compiles there; build-dev of ./test.sh has nearly all of it."""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
build, calls = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2] if len(sys.argv) > 2 else "100000"
options = [f"-DPython_EXECUTABLE={sys.executable}", "-DIDENTIKAL_BUILD_PYTHON=ON"]
if not (build / "CMakeCache.txt").exists():
    options += ["--preset", "dev", "-DCMAKE_UNITY_BUILD=ON", "-DIDENTIKAL_BUILD_TESTS=OFF", "-DIDENTIKAL_BUILD_BENCH=OFF"]
subprocess.run(["cmake", "-S", ROOT, "-B", build, *options], check=True, cwd=ROOT)
subprocess.run(["cmake", "--build", build, "--target", "identikal_python_package", "identikal", "-j", str(os.cpu_count() or 1)], check=True)
library = subprocess.run(["clang", "-print-file-name=libclang_rt.asan-x86_64.so"], capture_output=True, text=True, check=True).stdout.strip()
subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "(samples or models or results or random or refused or exceptions or several_outputs) and not command_line and not of_files",
                ROOT / "tests/python"], check=True,
               env={**os.environ, "LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
                    "PYTHONPATH": str(build / "python"), "IDENTIKAL_TOOL": str(build / "identikal"),
                    "IDENTIKAL_RANDOM_CALLS": calls, "PYTHONDONTWRITEBYTECODE": "1"})
