"""How long are functions and files? Prints the longest of both; fails where the house's limits are passed.

A function is counted from the line where its head begins to its closing brace. Limits: none above 120 lines, at most ten above 80,
no file above 700 lines.
"""
import pathlib
import re
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
HOUSES = ("lib", "solvers", "identify", "studies", "jobs", "fleet", "interface", "command", "python")
MOST_LINES_OF_FILE, MOST_LINES, LONG, MOST_LONG = 700, 120, 80, 10
NOT_A_FUNCTION = re.compile(r"^\s*(namespace|class|struct|enum|union|extern)\b")
CONTROL = re.compile(r"\b(if|for|while|switch|catch|else|do|try)\b")


def blanked(text):
    """The text without comments and literals, line by line as it was."""
    pattern = re.compile(r'//[^\n]*|/\*.*?\*/|R"(\w*)\(.*?\)\1"|"(?:\\.|[^"\\\n])*"|(?<!\w)\'(?:\\.|[^\'\\\n])+\'', re.S)
    return pattern.sub(lambda m: "\n" * m[0].count("\n"), text)


def functions(text):
    """(name, first line, lines) of every function body that is not inside another function."""
    stack, head, head_line, line = [], "", 1, 1
    for character in text:
        if character == "{":
            outer = any(kind == "function" for kind, *_ in stack)
            is_function = "(" in head and not NOT_A_FUNCTION.match(head) and not outer and not head.rstrip().endswith("=")
            stack.append(("function" if is_function else "other", head, head_line))
            head = ""
        elif character == "}":
            if stack:
                kind, opened, first = stack.pop()
                if kind == "function":
                    name = re.search(r"([\w:~]+|operator\S+)\s*\(", opened)
                    yield (name[1] if name else opened.strip()[:40]), first, line - first + 1
            head = ""
        elif character == ";" and head.count("(") == head.count(")"):
            head = ""
        else:
            if not head.strip() and not character.isspace():
                head, head_line = "", line
            head += character
            if character == "\n" and head.strip().startswith("#"):
                head = ""
            if re.fullmatch(r"\s*(public|private|protected)\s*:", head):
                head = ""
        line += character == "\n"


found, long_files = [], []
for house in HOUSES:
    for path in sorted((ROOT / house).rglob("*")):
        if path.suffix not in (".h", ".cpp", ".js"):
            continue
        name, text = path.relative_to(ROOT).as_posix(), path.read_text()
        long_files.append((text.count("\n"), name))
        if path.suffix != ".js":
            found += [(lines, f"{name}:{first}", what) for what, first, lines in functions(blanked(text))
                      if not CONTROL.fullmatch(what)]
found.sort(reverse=True)
long_files.sort(reverse=True)
above = [f for f in found if f[0] > LONG]
for lines, where, what in found[:max(15, len(above))]:
    print(f"{lines:5} {what}  {where}")
for lines, name in long_files[:5]:
    print(f"{lines:5} {name}")
faults = [f"{where}: {what} has {lines} lines; at most {MOST_LINES}" for lines, where, what in found if lines > MOST_LINES]
faults += [f"{name} has {lines} lines; at most {MOST_LINES_OF_FILE}" for lines, name in long_files if lines > MOST_LINES_OF_FILE]
if len(above) > MOST_LONG:
    faults.append(f"{len(above)} functions have more than {LONG} lines; at most {MOST_LONG}")
print(*faults, sep="\n")
print(f"{len(found)} functions, {len(above)} above {LONG} lines, longest {found[0][0]}; longest file {long_files[0][0]}")
sys.exit(bool(faults))
