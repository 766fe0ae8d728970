"""Does every public header show how it is used, and does that compile? examples.py [--write FOLDER]

An example stands in a comment of the header: a line `/// Example:`, an empty one, and at most five lines of code behind
five blanks, which is code for doxygen too. Fails on a public header that declares a function and has no example.
--write puts the examples of each house into FOLDER/HOUSE.cpp, each the body of a function of its own behind the include of
its header; the build compiles these files and runs nothing. What an example uses and does not introduce is one of VARIABLES."""
import ast
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
MOST_LINES = 5
# Rooms from the ground up: an example sees its header, those of the rooms below, and those before it in its room.
ORDER = ast.literal_eval(re.search(r"^ORDER = (\{.*?^\})", (ROOT / "tests/layers.py").read_text(encoding="utf-8"), re.S | re.M)[1])
# What the reader of an example has already: name, type, the header that declares it.
VARIABLES = {
    "lib": {
        "y": ("Eigen::MatrixXd", "lib/model/state_space.h"),  # outputs x samples
        "u": ("Eigen::MatrixXd", "lib/model/state_space.h"),  # inputs x samples
        "e": ("Eigen::MatrixXd", "lib/model/state_space.h"),  # innovations, outputs x samples
        "time": ("Eigen::VectorXd", "lib/model/state_space.h"),  # of the samples [s]
        "model": ("StateSpace", "lib/model/state_space.h"),
        "derivatives": ("std::vector<StateSpace>", "lib/model/state_space.h"),  # of the model by its parameters
        "pendulum": ("NonlinearModel", "lib/model/nonlinear_model.h"),
        "p": ("Eigen::VectorXd", "lib/model/state_space.h"),  # its parameters
        "noise": ("FilterNoise", "lib/nonlinear/filter.h"),  # its noise and start
        "car": ("SingleTrack<>", "lib/vehicle/single_track.h"),
        "sums": ("LaggedProducts", "lib/subspace/lagged_products.h"),
        "predictor": ("Predictor", "lib/subspace/predictor.h"),
        "states": ("Realisation", "lib/subspace/realisation.h"),
    },
    "identify": {
        "y": ("Eigen::MatrixXd", "lib/data/dataset.h"),  # outputs x samples
        "u": ("Eigen::MatrixXd", "lib/data/dataset.h"),  # inputs x samples
        "model": ("Model", "identify/model/model.h"),  # of a filter
        "car": ("Model", "identify/model/model.h"),  # a vehicle
        "recordings": ("std::vector<Dataset>", "lib/data/dataset.h"),  # of the model, or of the car
        "estimate": ("NoiseEstimate", "identify/estimate/results.h"),  # what tuning the model gave
        "stored": ("StoredResult", "identify/result/file.h"),  # the same from its folder
    },
}
VARIABLES["solvers"] = VARIABLES["lib"] | {"unknown_noise": ("NoiseProblem", "solvers/recursive_posterior.h")}
STANDARD = ("array", "cmath", "complex", "cstdio", "functional", "optional", "stdexcept", "string", "vector", "Eigen/Dense")
LITERAL = r'R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\''
OPENS_SCOPE = re.compile(r"\s*(template\b.*>\s*)?(inline\s+)?(namespace|class|struct|union|extern)\b[^(]*$", re.S)

faults = []


def public_headers(house):
    floor = {f"{house}/{room}".rstrip("/"): i for i, room in enumerate(ORDER[house])}
    headers = [path.relative_to(ROOT) for path in (ROOT / house).rglob("*.h") if "internal" not in path.parts]
    return sorted(headers, key=lambda path: (floor.get(path.parent.as_posix(), len(floor)), path))


def is_function(head):
    """Does a declaration's text up to its semicolon or brace declare a function?"""
    if re.match(r"\s*(static_assert|using|typedef|friend\s+(class|struct))\b", head):
        return False
    if re.search(r"\boperator\b", head):
        return True
    head, longer = head.split("=")[0], ""
    while head != longer:  # without the arguments of templates
        head, longer = re.sub(r"<[^<>]*>", "", head), head
    return bool(re.search(r"\w\s*\(", head))


def first_function(text):
    """Line of the first function that a header declares, members counted; None where it declares none."""
    text = re.sub(rf"//[^\n]*|/\*.*?\*/|^[ \t]*#(?:[^\n]*\\\n)*[^\n]*|{LITERAL}", lambda m: "\n" * m[0].count("\n"), text, flags=re.S | re.M)
    inside, head, line, begin = [], "", 1, 1  # inside: of every open brace, is it a scope of declarations?
    for character in text:
        if character in "{};":
            if all(inside) and is_function(head):
                return begin
            if character == "{":
                inside.append(all(inside) and bool(OPENS_SCOPE.match(head)))
            elif character == "}" and inside:
                inside.pop()
            head = ""
        else:
            if not head.strip():
                head, begin = "", line
            head += character
        line += character == "\n"
    return None


def examples_of(name, text):
    """(line of its first line of code, lines) of every example of a header."""
    lines, found = text.splitlines(), []
    for number, line in enumerate(lines, 1):
        if line.strip() != "/// Example:":
            continue
        code = []
        for below in lines[number + 1:]:
            if not (match := re.fullmatch(r"\s*///     (.*)", below)):
                break
            code.append(match[1])
        if lines[number].strip() != "///" or not code:
            faults.append(f"{name}:{number}: expected an empty line of the comment behind it, and then code behind five blanks")
        elif len(code) > MOST_LINES:
            faults.append(f"{name}:{number + 2}: an example of {len(code)} lines; at most {MOST_LINES}")
        else:
            found.append((number + 2, code))
    return found


def used_variables(code, house):
    bare = re.sub(rf"//[^\n]*|{LITERAL}", "", "\n".join(code))
    return {v: VARIABLES[house][v] for v in VARIABLES[house] if re.search(rf"(?<![\w.>:]){v}\b", bare)}


def source_of(house, examples):
    """One file of C++ with all examples of a house."""
    used = [used_variables(code, house) for _, _, code in examples]
    text = "".join(f"#include <{header}>\n" for header in STANDARD)
    text += "".join(f'#include "{header}"\n' for header in sorted({header for each in used for _, header in each.values()}))
    for number, ((name, line, code), variables) in enumerate(zip(examples, used)):
        parameters = ", ".join(f"{kind}& {variable}" for variable, (kind, _) in variables.items())
        text += (f'#include "{name}"\nnamespace identikal {{\nnamespace {{\nvoid example_{number}({parameters}) {{\n{{\n'
                 f'#line {line} "{ROOT / name}"\n' + "\n".join(code) + f'\n}}\n}}\n}}\n}}\n#line 1 "example {number + 1}"\n')
    return text


def main():
    shown, exempt = 0, []
    for house in ("lib", "solvers", "identify"):
        examples = []
        for path in public_headers(house):
            name, text = path.as_posix(), (ROOT / path).read_text(encoding="utf-8")
            here, function = examples_of(name, text), first_function(text)
            examples += [(name, line, code) for line, code in here]
            shown += bool(here)
            if function is None and not here:
                exempt.append(name)
            elif not here and not any(fault.startswith(f"{name}:") for fault in faults):
                faults.append(f"{name}:{function}: declares a function, and no example in the header shows one; expected '/// Example:', "
                              f"an empty line and at most {MOST_LINES} lines of code behind five blanks")
        if sys.argv[1:2] == ["--write"]:
            folder = pathlib.Path(sys.argv[2])
            folder.mkdir(parents=True, exist_ok=True)
            (folder / f"{house}.cpp").write_text(source_of(house, examples), encoding="utf-8")
    if sys.argv[1:2] == ["--write"]:
        return 0
    print(*faults, f"{shown} public headers with examples, {len(exempt)} declare no function: {', '.join(exempt)}; {len(faults)} faults", sep="\n")
    return bool(faults)


sys.exit(main())
