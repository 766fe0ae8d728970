"""Does another project get what it asks for, and nothing else? embedding_test.py CMAKE

Copies the sources to a folder with a blank and an ampersand in its name and configures projects that take them in by
add_subdirectory and by FetchContent, with every package but Eigen and Highway out of reach. Nothing is compiled."""
import pathlib
import re
import shutil
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
OUT_OF_REACH = ["Ceres", "NLopt", "nlohmann_json", "yaml-cpp", "fmt", "Boost", "OpenSSL", "Threads", "CLI11", "GTest", "Python3",
                "benchmark"]
TAKE_IN = {
    "add_subdirectory": 'add_subdirectory("{source}" identikal)',
    "FetchContent": 'include(FetchContent)\nFetchContent_Declare(identikal SOURCE_DIR "{source}")\nFetchContent_MakeAvailable(identikal)',
}
cmake = sys.argv[1]


def expect(holds, what):
    if not holds:
        sys.exit(what)


def configure(folder, source, how, targets, *options, without=OUT_OF_REACH):
    """A project whose program links `targets`: what CMake says, and the exit code."""
    folder.mkdir()
    (folder / "main.cpp").write_text("int main() {}\n")
    link = f"target_link_libraries(mine PRIVATE {targets})" if targets else ""
    (folder / "CMakeLists.txt").write_text(f"""cmake_minimum_required(VERSION 3.25)
project(embedding LANGUAGES CXX)
{TAKE_IN[how].format(source=source)}
add_executable(mine main.cpp)
{link}
""")
    unreachable = [f"-DCMAKE_DISABLE_FIND_PACKAGE_{package}=ON" for package in without]
    done = subprocess.run([cmake, "-G", "Ninja", "-S", folder, "-B", folder / "build", *unreachable, *options],
                          capture_output=True, text=True)
    return done.returncode, done.stdout + done.stderr


def made_by_all(folder):
    """The objects that `all` needs."""
    done = subprocess.run(["ninja", "-C", folder / "build", "-t", "inputs", "all"], capture_output=True, text=True, check=True)
    return re.findall(r"^(\S+\.o)$", done.stdout, re.M)


with tempfile.TemporaryDirectory() as name:
    folder = pathlib.Path(name)
    source = folder / "their & our sources"
    for part in ("cmake", "lib", "solvers", "identify"):
        shutil.copytree(ROOT / part, source / part)
    shutil.copy(ROOT / "CMakeLists.txt", source)

    for how in TAKE_IN:
        code, said = configure(folder / how, source, how, "identikal::lib")
        expect(code == 0, f"{how}: {said}")
        objects = made_by_all(folder / how)
        ours = [o for o in objects if "identikal_lib.dir" in o]
        expect(len(ours) > 50 and len(ours) == len(objects) - 1, f"{how}: all makes {objects}")
        rules = (folder / how / "build").rglob("cmake_install.cmake")
        expect(not any("file(INSTALL" in rule.read_text() for rule in rules), f"{how}: something of ours is installed")

    code, said = configure(folder / "unused", source, "add_subdirectory", "")
    expect(code == 0 and len(made_by_all(folder / "unused")) == 1, f"what nobody links is built: {said}")

    code, said = configure(folder / "more", source, "add_subdirectory", "identikal::identify", "-DIDENTIKAL_BUILD_IDENTIFY=ON",
                           without=["CLI11", "GTest", "Python3", "benchmark"])
    expect(code == 0, f"identikal::identify: {said}")
    directories = {re.match(r".*CMakeFiles/(\w+)\.dir", o).group(1) for o in made_by_all(folder / "more")}
    expect(directories == {"mine", "identikal_lib", "identikal_solvers", "identikal_identify"}, f"all makes {directories}")

    # Whatever is missing is said at once, with what to type.
    code, said = configure(folder / "missing", source, "add_subdirectory", "identikal::identify", "-DIDENTIKAL_BUILD_IDENTIFY=ON",
                           without=["Ceres", "fmt"])
    words = " ".join(said.split())
    expect(code != 0 and "Not found: Ceres, fmt." in words
           and "apt-get install --no-install-recommends libceres-dev libfmt-dev" in words, f"missing packages: {said}")
print("lib alone needs Eigen and Highway, adds nothing to all, and lives in a folder with a blank and an ampersand")
