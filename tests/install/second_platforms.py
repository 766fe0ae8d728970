"""Does it build elsewhere, without a warning, and pass its fast tests? second_platforms.py [SUITE]

In a root with another Debian (SUITE: trixie, with GCC 14, Ceres 2.2 and yaml-cpp 0.8), by g++ and by clang; the packages made
there install there. Needs root, debootstrap, a Debian mirror and an hour; without them it ends with 77."""
import os
import pathlib
import shutil
import sys
import tempfile

from minimal_root import Machine

TOOLS = "libgtest-dev libgmock-dev clang python3 python3-jsonschema python3-numpy"
UNITS = "-DCMAKE_UNITY_BUILD=ON -DCMAKE_UNITY_BUILD_BATCH_SIZE=16 -DIDENTIKAL_WERROR=ON -DIDENTIKAL_BUILD_BENCH=OFF"


def build_and_test(machine, folder, *options):
    machine.run(" ".join(["cmake --preset release -B", folder, UNITS, *options]))
    machine.run(f"packaging/with_progress.sh build.log Building cmake --build {folder}")
    machine.run(f"ctest --test-dir {folder} --output-on-failure -j $(nproc) -LE 'slow|release'")


if os.geteuid() != 0 or not shutil.which("debootstrap"):
    print("second platforms: needs root and debootstrap")
    sys.exit(77)
with tempfile.TemporaryDirectory() as name:
    machine = Machine(pathlib.Path(name), sys.argv[1] if len(sys.argv) > 1 else "trixie")
    try:
        machine.run(f"./prepare.sh $(cat packages.txt) {TOOLS}", network=True)
        build_and_test(machine, "build")
        machine.run("cpack --config build/CPackConfig.cmake && for p in ./*.deb; do dpkg-deb -f $p Package Depends; done")
        machine.run("apt-get install -y -q --no-install-recommends ./identikal_*.deb ./libidentikal-dev_*.deb", network=True)
        machine.run("identikal --version && rm *.deb")
        build_and_test(machine, "build-clang", "-DCMAKE_CXX_COMPILER=clang++")
    finally:
        machine.leave()
print("second platforms: g++ and clang build without a warning, fast tests pass, the packages install")
