"""Do the Debian packages install, work and leave again? package_test.py CMAKE CPACK BUILD VERSION

Root installs them with dpkg into a folder with a copy of the machine's list of packages, so that their dependencies are
checked and the machine stays as it is; anybody else unpacks them there."""
import os
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

from install_test import build_consumers, run

cmake, cpack, build, version = sys.argv[1:]


def fields(package):
    return dict(re.findall(r"^ ?([A-Z][\w-]*): (.*)$", run("dpkg-deb", "-I", package), re.M))


def expect(holds, what):
    if not holds:
        sys.exit(what)


def packages_of_what_it_calls(file, folder):
    """The packages, by the loader and dpkg of this machine, of the shared libraries that the program names."""
    run("dpkg-deb", "-x", file, folder / "unpacked")
    program = folder / "unpacked/usr/bin/identikal"
    named = set(re.findall(r"NEEDED\s+(\S+)", run("objdump", "-p", program)))
    paths = dict(re.findall(r"(\S+) => (\S+)", run("ldd", program)))
    # Which BLAS and LAPACK it is, the administrator of a machine chooses.
    owned = [n for n in named if n in paths and not (os.path.islink(paths[n]) and "/alternatives/" in os.readlink(paths[n]))]
    # The loader names /lib where packages hold /usr/lib, or the other way round.
    return sorted({run("dpkg", "-S", "*" + paths[n].removeprefix("/usr")).split(":")[0] for n in owned})


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    run(cpack, "-G", "DEB", "--config", pathlib.Path(build) / "CPackConfig.cmake", "-B", folder / "cpack")
    architecture = run("dpkg", "--print-architecture").strip()
    packages = {p: folder / f"cpack/{p}_{version}_{architecture}.deb" for p in ("identikal", "libidentikal-dev", "python3-identikal")}
    for package, file in packages.items():
        control = fields(file)
        expected = {"Package": package, "Version": version, "Architecture": architecture,
                    "Section": {"identikal": "science", "libidentikal-dev": "libdevel", "python3-identikal": "python"}[package],
                    "Maintainer": "Identikal developers <developers@identikal.invalid>"}
        expect(expected.items() <= control.items() and control["Description"], f"{package}: {control}")
        depends = re.findall(r"([a-z0-9.+-]+)(?: \([^)]*\))?(?:, |$)", control["Depends"])
        needed = {"identikal": lambda: packages_of_what_it_calls(file, folder), "python3-identikal": lambda: ["python3", "python3-numpy"],
                  "libidentikal-dev": lambda: ["libeigen3-dev", "libceres-dev", "libhwy-dev"]}[package]()
        expect(needed and set(needed) <= set(depends), f"{package} depends on {depends}, which lacks some of {needed}")
        names = [line.split()[5] for line in run("dpkg-deb", "-c", file).splitlines()]
        expect(all(n == "./" or n.startswith("./usr/") for n in names), f"{package}: {names}")
        expect(f"./usr/share/doc/{package}/copyright" in names, f"{package}: no copyright")
        wanted = {"identikal": ["bin/identikal", "share/man/man1/identikal.1", "share/bash-completion/completions/identikal",
                                "share/zsh/vendor-completions/_identikal", "share/fish/vendor_completions.d/identikal.fish",
                                "share/identikal/examples/nile.yaml", "share/identikal/data/nile.csv", "share/doc/identikal/CHANGELOG.md",
                                "share/doc/identikal/README.md", "share/doc/identikal/THIRD_PARTY_NOTICES.md", "share/doc/identikal/docs/tune-a-filter.md"],
                  "python3-identikal": [f"lib/python3/dist-packages/identikal/{file}" for file in ("__init__.py", "__init__.pyi", "py.typed")],
                  "libidentikal-dev": ["include/identikal/lib/filter/kalman.h", "include/identikal/identify/noise/ml.h", "include/identikal/lib/version.h", "lib/pkgconfig/identikal.pc",
                                       "lib/cmake/identikal/identikal-config.cmake", "lib/libidentikal_lib.a", "share/doc/libidentikal-dev/THIRD_PARTY_NOTICES.md"]}[package]
        missing = [w for w in wanted if f"./usr/{w}" not in names]
        expect(not missing, f"{package} lacks {missing}")
        expect(not any("/internal/" in n or "site-functions" in n for n in names), f"{package}: {names}")

    root = folder / "root"
    is_root = os.geteuid() == 0
    if is_root:
        database = root / "var/lib/dpkg"
        (database / "updates").mkdir(parents=True)
        (database / "info").mkdir()
        shutil.copy("/var/lib/dpkg/status", database)
        dpkg = ["dpkg", f"--root={root}", "--force-script-chrootless"]
        run(*dpkg, "-i", *packages.values())
    else:
        for file in packages.values():
            run("dpkg-deb", "-x", file, root)
    expect(run(root / "usr/bin/identikal", "--version").startswith(f"identikal {version}\n"), "not that version")
    said = subprocess.run(["/usr/bin/python3", "-c", "import identikal; print(identikal.__version__)"], capture_output=True, text=True, check=False,
                          env={**os.environ, "PYTHONPATH": str(root / "usr/lib/python3/dist-packages"), "PYTHONDONTWRITEBYTECODE": "1"})
    expect(said.stdout.strip() == version, f"Python: {said.stdout}{said.stderr}")
    build_consumers(cmake, root / "usr", folder, version)
    if is_root:
        run(*dpkg, "--purge", *packages)
        left = [f for f in root.rglob("*") if not f.is_relative_to(root / "var") and f != root / "var"]
        expect(not left, f"left behind: {left}")
print("the packages install, work and leave" if is_root else "the packages unpack and work (installing them takes root)")
