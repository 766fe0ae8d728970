"""Do the installed headers stand on their own, and bring nothing but Eigen and the standard library?

public_headers.py COMPILER EIGEN_INCLUDE HEADER...: with clang++ where it is installed, copies the headers to a folder of their own and compiles them there,
each alone, or as the first include of its own .cpp in the build, which is the same. Whatever file they read has to be
one of them, or one that Eigen and the standard headers read anyway."""
import concurrent.futures
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
compiler, eigen, *headers = sys.argv[1:]
compiler = shutil.which("clang++") or compiler
faults = []


def compile_text(folder, name, text, include):
    """Every file that `text` reads, or the compiler's complaint as one string."""
    source, list_of_files = folder / f"{name}.cpp", folder / f"{name}.d"
    source.write_text(text)
    run = subprocess.run([compiler, "-std=c++20", "-Wall", "-Wextra", "-Werror", "-fsyntax-only", "-MD", "-MF", list_of_files,
                          "-I", include, "-isystem", eigen, source], capture_output=True, text=True)
    if run.returncode:
        return run.stderr
    words = re.sub(r"\\\n", " ", list_of_files.read_text().split(":", 1)[1]).split()
    return {pathlib.Path(word).resolve() for word in words}


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name).resolve()
    include = folder / "include"
    names, alone, standard = [], [], set()
    for header in map(pathlib.Path, headers):
        # Below the source tree, or made by CMake in a folder of that layout.
        names.append(re.search(r"(lib|solvers|identify)/(?!.*/(lib|solvers|identify)/).*", header.as_posix()).group(0)
                     if not header.is_relative_to(ROOT) or "generated" in header.parts
                     else header.relative_to(ROOT).as_posix())
        target = include / names[-1]
        target.parent.mkdir(parents=True, exist_ok=True)
        shutil.copy(header, target)
        standard |= set(re.findall(r"#include <([a-z0-9_]+)>", header.read_text()))
        source = ROOT / names[-1].replace(".h", ".cpp")
        if not source.exists():
            alone.append(names[-1])
        elif re.search(r"#include (\S+)", source.read_text()).group(1) != f'"{names[-1]}"':
            faults.append(f"{source.relative_to(ROOT)}: its own header does not come first")
    jobs = {"known": "".join(f"#include <{h}>\n" for h in sorted(standard) + ["Eigen/Dense", "Eigen/Sparse"]),
            "all": "".join(f'#include "{h}"\n' for h in names)}
    jobs |= {h.replace("/", "_"): f'#include "{h}"\n' for h in alone}
    with concurrent.futures.ThreadPoolExecutor() as pool:
        futures = {job: pool.submit(compile_text, folder, job, text, include) for job, text in jobs.items()}
    answers = {job: future.result() for job, future in futures.items()}
    faults += [answer for answer in answers.values() if isinstance(answer, str)]
    if not faults:
        leaks = {f for f in answers["all"] - answers["known"] if not f.is_relative_to(folder)}
        faults += [f"{f}: a public header brings it along" for f in sorted(leaks)]
print("\n".join(faults) or f"{len(names)} public headers bring Eigen and the standard library only, {len(alone)} compiled alone")
sys.exit(bool(faults))
