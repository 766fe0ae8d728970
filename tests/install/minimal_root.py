"""Does it work on a machine that has nothing, and what does that cost? minimal_root.py [SUITE] [--test]

Makes a minimal Debian (SUITE: bookworm) in a folder and copies the sources there, into a folder with a blank and an ampersand
in its name. Then README's first steps: ./run.sh twice, Install, the packages installed by apt, and with --test ./test.sh.
After the packages are there nothing has a network. Prints what run.sh costs and fails above its limits. Needs root,
debootstrap, a Debian mirror and half an hour; without them it ends with 77."""
import argparse
import os
import pathlib
import re
import resource
import shlex
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time

ROOT = pathlib.Path(__file__).resolve().parents[2]
HOME = "/root/tools & models/identikal"
LIMITS = {"packages": 150, "MB down": 150, "processor minutes": 8, "GB at the compiler's peak": 1, "s of silence": 75,
          "s the second time": 5}


def sources():
    """What git keeps, or without git all but what builds leave."""
    listed = subprocess.run(["git", "-C", ROOT, "ls-files", "-z", "--cached", "--others", "--exclude-standard"], capture_output=True)
    if listed.returncode == 0:
        return [n for n in listed.stdout.decode().split("\0") if n and (ROOT / n).exists()]
    return [p.relative_to(ROOT).as_posix() for p in ROOT.rglob("*")
            if p.is_file() and not re.match(r"(build|out|\.git|\.cache)", p.relative_to(ROOT).as_posix())]


class Machine:
    """A root directory, and commands in it."""

    def __init__(self, folder, suite):
        self.root = folder / "root"
        subprocess.run(["debootstrap", "--variant=minbase", suite, self.root], check=True, stdout=subprocess.DEVNULL)
        for name in ("resolv.conf", "hosts"):
            shutil.copy(f"/etc/{name}", self.root / "etc")
        subprocess.run(["mount", "-t", "proc", "proc", self.root / "proc"], check=True)
        subprocess.run(["mount", "-t", "devpts", "-o", "newinstance,ptmxmode=0666", "devpts", self.root / "dev/pts"], check=True)
        (self.root / "dev/ptmx").unlink(missing_ok=True)
        (self.root / "dev/ptmx").symlink_to("pts/ptmx")
        for name in sources():
            target = self.root / HOME[1:] / name
            target.parent.mkdir(parents=True, exist_ok=True)
            shutil.copy(ROOT / name, target)

    def leave(self):
        subprocess.run(["umount", self.root / "dev/pts", self.root / "proc"])

    def run(self, command, network=False):
        """Prints what it prints; its output, wall seconds, longest silence, processor seconds, most memory of a process in bytes."""
        print(f"$ {command}", flush=True)
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        begin = last = time.monotonic()
        silence, lines = 0.0, []
        inside = ["chroot", self.root, "/usr/bin/env", "-i", "HOME=/root", "PATH=/usr/sbin:/usr/bin:/sbin:/bin", "LANG=C.UTF-8",
                  "/bin/bash", "-c", f"cd {shlex.quote(HOME)} && {command}"]
        done = subprocess.Popen([*([] if network else ["unshare", "--net"]), *inside], text=True, errors="replace",
                                stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT)
        for line in done.stdout:
            silence, last = max(silence, time.monotonic() - last), time.monotonic()
            print(line, end="", flush=True)
            lines.append(line)
        if done.wait():
            sys.exit(f"exit code {done.returncode}: {command}")
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
        cpu = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
        return "".join(lines), time.monotonic() - begin, silence, cpu, after.ru_maxrss * 1024


def expect(holds, what):
    if not holds:
        sys.exit(f"minimal root: {what}")


def first_steps(machine):
    """./run.sh twice: what it costs."""
    archives = machine.root / "var/cache/apt/archives"
    before = set(archives.glob("*.deb"))
    _, _, silence_before, cpu_before, _ = machine.run("./prepare.sh $(cat packages.txt)", network=True)
    fetched = [f.stat().st_size for f in archives.glob("*.deb") if f not in before]
    out, _, silence, cpu, peak = machine.run("./run.sh")
    expect("log-likelihood -632.545625" in out and re.search(r"^Cf ", out, re.M), "the tables are not there")
    for result in ("nile/result.json", "severe_lane_change/result.json", "report_noise.html", "report_vehicle.html"):
        expect((machine.root / HOME[1:] / "out" / result).stat().st_size > 0, f"no {result}")
    _, again, *_ = machine.run("./run.sh")
    return {"packages": len(fetched), "MB down": sum(fetched) / 1e6, "processor minutes": (cpu_before + cpu) / 60, "GB at the compiler's peak": peak / 1e9,
            "s of silence": max(silence_before, silence), "s the second time": again}


def install(machine):
    """README's Install: into the home directory, and as packages."""
    machine.run("cmake --install build --prefix ~/.local | tail -n 1")
    out, *_ = machine.run("~/.local/bin/identikal --version")
    expect(out.startswith("identikal "), out)
    expect((machine.root / "root/.local/share/man/man1/identikal.1").exists(), "no manual page")
    machine.run("cpack --config build/CPackConfig.cmake")
    machine.run("for p in ./*.deb; do dpkg-deb -f $p Package Depends; done")
    machine.run("apt-get install -y -q --no-install-recommends ./identikal_*.deb ./libidentikal-dev_*.deb", network=True)
    machine.run("identikal --version && identikal init local-level > /dev/null")


def main():
    arguments = argparse.ArgumentParser()
    arguments.add_argument("suite", nargs="?", default="bookworm")
    arguments.add_argument("--test", action="store_true", help="run ./test.sh there as well")
    options = arguments.parse_args()
    if os.geteuid() != 0 or not shutil.which("debootstrap"):
        print("minimal root: needs root and debootstrap")
        sys.exit(77)
    with tempfile.TemporaryDirectory() as name:
        machine = Machine(pathlib.Path(name), options.suite)
        try:
            cost = first_steps(machine)
            print("\n".join(f"run.sh: {value:.1f} {what} (at most {LIMITS[what]})" for what, value in cost.items()))
            install(machine)
            if options.test:
                machine.run("./test.sh", network=True)
        finally:
            machine.leave()
    above = [what for what, value in cost.items() if value > LIMITS[what]]
    expect(not above, f"too many {', '.join(above)}")
    print("minimal root: run.sh, Install and the packages work" + (", test.sh passes" if options.test else ""))


if __name__ == "__main__":
    main()
