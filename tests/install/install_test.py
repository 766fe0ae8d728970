"""Can another project use what is installed? install_test.py CMAKE BUILD VERSION

Installs into a folder, builds tests/install/consumer (a program, and a shared library) against it by find_package, and by
pkg-config with the compiler alone, and compares with the published estimates of the Nile's level: Durbin & Koopman (2012), section 2.10, more digits
by other implementations."""
import os
import pathlib
import platform
import shlex
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
CONSUMER = ROOT / "tests/install/consumer"
EXPECTED = "q 1469.18\nr 15098.52\nlog-likelihood -632.5456251\n"


def run(*command, **options):
    out = subprocess.run([str(c) for c in command], capture_output=True, text=True, **options)
    if out.returncode:
        sys.exit(f"{shlex.join(str(c) for c in command)}: exit code {out.returncode}\n{out.stdout}{out.stderr}")
    return out.stdout


def check_consumer(program, share, version):
    out = run(program, share / "examples/nile.yaml", share / "data/nile.csv")
    if out != f"identikal {version}\n{EXPECTED}":
        sys.exit(f"{program} printed\n{out}instead of version {version} and\n{EXPECTED}")


def build_consumers(cmake, prefix, folder, version):
    """By find_package and by pkg-config, and in C."""
    share = prefix / "share/identikal"
    run(cmake, "-S", CONSUMER, "-B", folder / "build", "-G", "Ninja", f"-DCMAKE_PREFIX_PATH={prefix}")
    run(cmake, "--build", folder / "build")
    check_consumer(folder / "build/consumer", share, version)
    rows = run(folder / "build/host", share / "data/nile.csv")
    if rows != "100 rows, -1 without a file\n":
        sys.exit(f"the shared library that links ours says {rows}")

    flags = run("pkg-config", "--cflags", "--libs", "identikal", env=pc_environment(prefix)).split()
    plain = folder / "plain"
    run("g++", "-O0", CONSUMER / "main.cpp", "-o", plain, *flags)
    check_consumer(plain, share, version)
    in_c = folder / "in_c"
    flags = run("pkg-config", "--cflags", "--libs", "identikal-c", env=pc_environment(prefix)).split()
    run("gcc", "-std=c99", "-Wall", "-Werror", ROOT / "examples/tune_tracker.c", "-o", in_c, *flags,
        f"-Wl,-rpath,{next(prefix.glob('lib/**/libidentikal.so')).parent}")
    if "innovations" not in run(in_c):
        sys.exit(f"{in_c} prints no innovations")


def build_for_this_machine(prefix, folder, version):
    """Flags that would crash it are refused."""
    if platform.machine() != "x86_64":
        return
    flags = run("pkg-config", "--cflags", "--libs", "identikal", env=pc_environment(prefix)).split()
    wide = folder / "wide"
    run("g++", "-O1", "-march=native", CONSUMER / "main.cpp", "-o", wide, *flags)
    check_consumer(wide, prefix / "share/identikal", version)
    misaligned = [flag for flag in flags if flag != "-mno-avx"]
    refused = subprocess.run(["g++", "-mavx2", "-fsyntax-only", CONSUMER / "main.cpp", *misaligned], capture_output=True, text=True)
    if refused.returncode == 0 or "-mno-avx" not in refused.stderr:
        sys.exit(f"-mavx2 with another alignment is not refused: {refused.stderr}")


def pc_environment(prefix):
    folders = ":".join(str(p.parent) for p in prefix.glob("lib/**/identikal.pc"))
    return {**os.environ, "PKG_CONFIG_PATH": folders}


def main():
    cmake, build, version = sys.argv[1:]
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        prefix = folder / "prefix"
        run(cmake, "--install", build, "--prefix", prefix)
        found = run("pkg-config", "--modversion", "identikal", env=pc_environment(prefix)).strip()
        if found != version or not run(prefix / "bin/identikal", "--version").startswith(f"identikal {version}\n"):
            sys.exit(f"not version {version}")
        for file in [f for f in prefix.rglob("*.cmake")] + [f for f in prefix.rglob("*.pc")]:
            for path in (ROOT, build, prefix):
                if str(path) in file.read_text():
                    sys.exit(f"{file.relative_to(prefix)} names {path}, which is not there on another machine")
        build_consumers(cmake, prefix, folder, version)
        build_for_this_machine(prefix, folder, version)
    print("the installed library builds and runs: find_package, pkg-config")


if __name__ == "__main__":
    main()
