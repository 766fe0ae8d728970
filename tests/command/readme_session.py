"""The sessions in README.md and docs/ are what the tool prints today. With --write they are copied from it again.

A line `    $ command` of a page is run by the shell, in a scratch folder of that page where build, data and examples lie beside what its commands
have written before; the indented lines below are what it prints, errors included. A command goes on behind a backslash, and to the END of <<END.
C++ on a page is out of the example that the page names last before it, which is compiled and run: every line but "..." stands there too.
"""
import difflib
import pathlib
import re
import subprocess
import sys
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROMPT = "    $ "


def printed(command, folder):
    run = subprocess.run(["bash", "-c", command], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
                         text=True, cwd=folder)
    return [("    " + line).rstrip() for line in run.stdout.rstrip("\n").split("\n")] if run.stdout else []


def rerun(lines, folder):
    out, at = [], 0
    while at < len(lines):
        line = lines[at]
        at += 1
        out.append(line)
        if not line.startswith(PROMPT):
            continue
        command = [line[len(PROMPT):]]
        while command[-1].endswith("\\") or ("<<END" in command[0] and command[-1] != "END"):
            out.append(lines[at])
            command.append(lines[at][4:])
            at += 1
        end = at
        while end < len(lines) and not lines[end].startswith(PROMPT) and (not lines[end] or lines[end].startswith("    ")):
            end += 1
        out += printed("\n".join(command), folder)
        if end > at and not lines[end - 1]:
            out.append("")
        at = end
    return out


def page_now(page, program):
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for entry, target in {"build": program.parent, "data": ROOT / "data", "examples": ROOT / "examples"}.items():
            (folder / entry).symlink_to(target)
        return "\n".join(rerun(page.read_text().split("\n"), folder))


def lines_of_no_example(page):
    out = []
    text = page.read_text()
    for block in re.finditer(r"```cpp\n(.*?)```", text, re.S):
        named = re.findall(r"\]\([./]*(examples/\w+\.cpp)\)", text[:block.start()])
        known = {line.strip() for line in (ROOT / named[-1]).read_text().splitlines()} if named else set()
        out += [line for line in block[1].splitlines() if line.strip() not in known | {"...", ""}]
    return out


program = pathlib.Path(sys.argv[1]).resolve()
changed = False
for page in [ROOT / "README.md", *sorted((ROOT / "docs").glob("*.md"))]:
    text = page.read_text()
    now = page_now(page, program)
    if "--write" in sys.argv:
        page.write_text(now)
    elif now != text:
        changed = True
        sys.stdout.writelines(difflib.unified_diff(text.splitlines(True), now.splitlines(True), str(page.relative_to(ROOT)), "printed now"))
    for line in lines_of_no_example(page):
        changed = True
        print(f"{page.relative_to(ROOT)}: in no example: {line}")
sys.exit(changed)
