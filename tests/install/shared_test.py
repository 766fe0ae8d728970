"""Do the libraries work as shared ones? shared_test.py CMAKE BUILD VERSION [--build]

Makes one shared library of the static ones of BUILD with the linker's options that BUILD_SHARED_LIBS takes, looks at the names that
it shows, and links somebody else's shared library to it. With --build (minutes) CMake builds and installs them, and the
consumers of install_test.py are built against that."""
import os
import pathlib
import re
import sys
import tempfile

from install_test import CONSUMER, ROOT, build_consumers, run

cmake, build, version = sys.argv[1:4]
LAYERS = {"lib": "read_csv", "solvers": "solve", "identify": "tune_ml"}  # and a function of each
THEIRS = ["-lceres", "-lglog", "-lnlopt", "-lhwy", "-lyaml-cpp", "-lfmt", "-lcrypto", "-pthread"]


def expect(holds, what):
    if not holds:
        sys.exit(what)


def check_names(library, some):
    """Namespace identikal and nothing else; `some` of it has to be there."""
    names = [line.split()[2] for line in run("nm", "-D", "--defined-only", library).splitlines()]
    foreign = [n for n in names if not re.match(r"_Z(N|NK|GVN|TIN|TSN|TVN|TTN)9identikal", n)]
    expect(not foreign, f"{library.name} shows {foreign[:5]}")
    shown = run("c++filt", *names)
    expect(f"identikal::{some}(" in shown, f"{library.name} hides {some}")
    return len(names)


def link_archives(folder):
    options = ["-Wl,--no-undefined", "-Wl,-z,text", f"-Wl,--version-script={ROOT}/cmake/exports.map"]
    library = folder / "libidentikal.so"
    run("g++", "-shared", "-o", library, "-Wl,--whole-archive", *[f"{build}/{layer}/libidentikal_{layer}.a" for layer in LAYERS],
        "-Wl,--no-whole-archive", *THEIRS, *options)
    for some in LAYERS.values():
        count = check_names(library, some)
    print(f"{library.name} shows {count} names")
    run("g++", "-std=c++20", "-O1", "-fPIC", "-shared", "-o", folder / "libplugin.so", CONSUMER / "plugin.cpp",
        "-I", ROOT, "-I", f"{build}/generated", "-isystem", "/usr/include/eigen3", library, *options[:2], f"-Wl,-rpath,{folder}")
    run("g++", "-O1", "-o", folder / "host", CONSUMER / "host.cpp", folder / "libplugin.so", f"-Wl,-rpath,{folder}")
    rows = run(folder / "host", ROOT / "data/nile.csv")
    expect(rows == "100 rows, -1 without a file\n", f"the shared library that links ours says {rows}")


def build_and_install(folder):
    shared, prefix = folder / "shared", folder / "prefix"
    run(cmake, "-G", "Ninja", "-S", ROOT, "-B", shared, "-DBUILD_SHARED_LIBS=ON", "-DCMAKE_UNITY_BUILD=ON", "-DCMAKE_UNITY_BUILD_BATCH_SIZE=16",
        "-DIDENTIKAL_BUILD_TESTS=OFF", "-DIDENTIKAL_BUILD_BENCH=OFF")
    run(cmake, "--build", shared)
    run(cmake, "--install", shared, "--prefix", prefix)
    for layer, some in LAYERS.items():
        library, = prefix.glob(f"lib/**/libidentikal_{layer}.so.{version}")
        check_names(library, some)
        soname = re.search(r"SONAME\s+(\S+)", run("objdump", "-p", library)).group(1)
        expect(soname == f"libidentikal_{layer}.so.{version.rpartition('.')[0]}", soname)
    expect(run(prefix / "bin/identikal", "--version").startswith(f"identikal {version}\n"), "the program does not find its libraries")
    # A prefix that the loader does not know, as of anybody who installs into a folder of his own.
    os.environ["LD_LIBRARY_PATH"] = str(library.parent)
    build_consumers(cmake, prefix, folder, version)


with tempfile.TemporaryDirectory() as name:
    (build_and_install if "--build" in sys.argv else link_archives)(pathlib.Path(name))
print("shared libraries show namespace identikal alone, and link into another shared library")
