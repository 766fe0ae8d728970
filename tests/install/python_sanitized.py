"""The package for Python under AddressSanitizer and UndefinedBehaviorSanitizer: its tests, and many random calls.

python_sanitized.py BUILD [CALLS]: compiles into BUILD, half an hour on two cores."""
import os
import pathlib
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
build, calls = pathlib.Path(sys.argv[1]).resolve(), sys.argv[2] if len(sys.argv) > 2 else "100000"
subprocess.run(["cmake", "-S", ROOT, "-B", build, "-DCMAKE_CXX_COMPILER=g++", "-DCMAKE_BUILD_TYPE=Release", "-DIDENTIKAL_SANITIZE=ON",
                "-DIDENTIKAL_BUILD_PYTHON=ON", "-DIDENTIKAL_BUILD_TESTS=OFF", "-DIDENTIKAL_BUILD_BENCH=OFF", "-DIDENTIKAL_INSTALL=OFF",
                "-DIDENTIKAL_BUILD_STUDIES=OFF", "-DCMAKE_UNITY_BUILD=ON", f"-DPython_EXECUTABLE={sys.executable}"], check=True)
subprocess.run(["cmake", "--build", build, "--target", "identikal_python_package", "identikal", "-j", str(os.cpu_count() or 1)], check=True)
library = subprocess.run(["g++", "-print-file-name=libasan.so"], capture_output=True, text=True, check=True).stdout.strip()
subprocess.run([sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-k", "not memory_stays and not the_tool and not interruption",
                ROOT / "tests/python"], check=True,
               env={**os.environ, "LD_PRELOAD": library, "ASAN_OPTIONS": "detect_leaks=0", "PYTHONMALLOC": "malloc",
                    "PYTHONPATH": str(build / "python"), "IDENTIKAL_TOOL": str(build / "identikal"),
                    "IDENTIKAL_RANDOM_CALLS": calls, "PYTHONDONTWRITEBYTECODE": "1"})
