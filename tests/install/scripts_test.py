"""Do prepare.sh and packaging/with_progress.sh say what they should? scripts_test.py

With stand-ins for dpkg-query, id and apt-get on the path, so that nothing is installed."""
import os
import pathlib
import pty
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]


def expect(holds, what):
    if not holds:
        sys.exit(str(what))


def stand_ins(folder, **programs):
    """A folder with these programs and the few that the scripts call."""
    folder.mkdir()
    for name, text in programs.items():
        (folder / name.replace("_", "-")).write_text(f"#!/bin/bash\n{text}\n")
        (folder / name.replace("_", "-")).chmod(0o755)
    for name in ("bash", "cat", "grep", "env"):
        (folder / name).symlink_to(shutil.which(name))
    return {**os.environ, "PATH": str(folder)}


def prepare(environment, *packages):
    done = subprocess.run([ROOT / "prepare.sh", *packages], env=environment, capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr


def check_prepare(folder):
    dpkg = 'echo "installed cmake"; echo "config-files ninja-build"; exit 1'
    line = "apt-get install -y --no-install-recommends g++ ninja-build"

    code, out, err = prepare(stand_ins(folder / "user", dpkg_query=dpkg, id="echo 1000"), "g++", "cmake", "ninja-build")
    expect(code == 1 and f"    apt-get update && {line}\n" in err and out == "", (code, out, err))
    code, out, err = prepare(stand_ins(folder / "root", dpkg_query=dpkg, id="echo 0", apt_get='echo "apt-get $*"'),
                             "g++", "cmake", "ninja-build")
    expect(code == 0 and out == f"Installing: g++ ninja-build\napt-get update -q\n{line} -q\n", (code, out, err))
    code, out, err = prepare(stand_ins(folder / "offline", dpkg_query=dpkg, id="echo 0", apt_get="exit 100"), "g++", "ninja-build")
    expect(code == 1 and f"sudo {line}\n" in err, (code, out, err))
    code, out, err = prepare(stand_ins(folder / "ready", dpkg_query='echo "installed cmake"'), "cmake")
    expect((code, out, err) == (0, "", ""), (code, out, err))
    code, out, err = prepare(stand_ins(folder / "elsewhere"), "cmake")
    expect(code == 0 and "no Debian here" in out, (code, out, err))


def check_generator(folder):
    for name, generator in (("plain", "Ninja"), ("with a blank", "Ninja"), ("tools & models", "Unix Makefiles"), ("it's", "Unix Makefiles")):
        (folder / name).mkdir()
        out = subprocess.run([ROOT / "packaging/generator.sh"], cwd=folder / name, capture_output=True, text=True).stdout
        expect(out == generator + "\n", (name, out))


def progress(folder, script):
    log = folder / "a log & more"
    log.write_text("before\n")
    done = subprocess.run([ROOT / "packaging/with_progress.sh", log, "Building", "bash", "-c", script], capture_output=True, text=True)
    return done.returncode, done.stdout, done.stderr, log.read_text()


def check_progress(folder):
    code, out, err, log = progress(folder, "echo one; echo; printf two; sleep 1.2; echo -n three")
    expect((code, err, log) == (0, "", "before\none\n\ntwothree") and out.startswith("Building; all of it goes to "), (code, out, err, log))
    code, out, err, log = progress(folder, "echo a.cpp:1:2: error: wrong; for i in {1..99}; do echo line $i; done; exit 3")
    expect(code == 3 and err.startswith("a.cpp:1:2: error: wrong\n") and "line 90" not in err and "line 99" in log
           and "Building failed (exit code 3); all of it is in" in err, (code, out, err))
    code, out, err, log = progress(folder, "echo '-- Found this'; echo 'CMake Error at x:1:'; echo '  Not found: Ceres. On Debian:'; exit 1")
    expect(code == 1 and err.startswith("CMake Error at x:1:\n  Not found: Ceres.") and "Found this" not in err, err)
    code, out, err, log = progress(folder, "for i in {1..99}; do echo line $i; done; kill -TERM $$")
    expect(code == 143 and "\nline 70\n" in err and "line 69\n" not in err, (code, err))

    screen, terminal = pty.openpty()
    status = subprocess.run([ROOT / "packaging/with_progress.sh", folder / "log", "Building", "bash", "-c",
                             "echo '[1/2] first'; echo '[2/2] last'"], stdout=terminal).returncode
    shown = os.read(screen, 65536)
    expect(status == 0 and b"\n" not in shown and b"\r\x1b[KBuilding: [2/2] last" in shown and shown.endswith(b"\r\x1b[K"), shown)


with tempfile.TemporaryDirectory() as name:
    check_generator(pathlib.Path(name))
    check_prepare(pathlib.Path(name))
    check_progress(pathlib.Path(name))
print("generator.sh knows which names ninja reads, prepare.sh says what to type, with_progress.sh shows progress and errors")
