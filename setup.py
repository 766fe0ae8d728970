"""Compiles identikal._identikal by CMake. IDENTIKAL_BUILD names a folder of an earlier build to go on with."""
import os
import pathlib
import re
import subprocess
import sys

from setuptools import Extension, setup
from setuptools.command.build_ext import build_ext

ROOT = pathlib.Path(__file__).resolve().parent


class BuildByCMake(build_ext):
    def build_extension(self, ext):
        target = pathlib.Path(self.get_ext_fullpath(ext.name)).resolve()
        build = pathlib.Path(os.environ.get("IDENTIKAL_BUILD", self.build_temp)).resolve()
        options = ["-DCMAKE_BUILD_TYPE=Release", "-DIDENTIKAL_BUILD_PYTHON=ON", f"-DPython_EXECUTABLE={sys.executable}"]
        if not (build / "CMakeCache.txt").exists():
            options += ["-DIDENTIKAL_BUILD_TESTS=OFF", "-DIDENTIKAL_BUILD_BENCH=OFF", "-DIDENTIKAL_INSTALL=OFF", "-DCMAKE_UNITY_BUILD=ON"]
        subprocess.run(["cmake", "-S", ROOT, "-B", build, *options], check=True)
        subprocess.run(["cmake", "--build", build, "--target", "identikal_python", "-j", str(os.cpu_count() or 1)], check=True)
        target.parent.mkdir(parents=True, exist_ok=True)
        module, = (build / "python/identikal").glob("_identikal*.so")
        self.copy_file(str(module), str(target))


version = re.search(r"project\(identikal VERSION (\S+)", (ROOT / "CMakeLists.txt").read_text())[1]
setup(version=version, ext_modules=[Extension("identikal._identikal", sources=[])], cmdclass={"build_ext": BuildByCMake})
