"""The sessions in README.md are what the tool prints today. With --write they are copied from it anew."""
import pathlib
import re
import subprocess
import sys

ROOT = pathlib.Path(__file__).resolve().parent.parent
README = ROOT / "README.md"
program = sys.argv[1]


def session(match):
    words = match.group(1).split()
    printed = subprocess.run([program, *words], capture_output=True, text=True, cwd=ROOT).stdout
    indented = "".join(("    " + line).rstrip() + "\n" for line in printed.rstrip("\n").split("\n"))
    return f"    $ build/identikal {match.group(1)}\n{indented}"


text = README.read_text()
now = re.sub(r"    \$ build/identikal (.*)\n(?:(?:    .*)?\n)*?(?=\n\S)", session, text)
if "--write" in sys.argv:
    README.write_text(now)
elif now != text:
    import difflib
    sys.stdout.writelines(difflib.unified_diff(text.splitlines(True), now.splitlines(True), "README.md", "printed now"))
    sys.exit(1)
