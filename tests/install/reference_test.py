"""Is every public function documented, and does doxygen understand it? reference_test.py DOXYGEN DOXYFILE

Members whose names say what they are need no sentence: fields, values of enumerations, accessors, structs; nor do the
arithmetic of Dual and RecordedScalar and arguments that stand in the sentence above the function. A declaration right below another,
without a blank line, shares its comment."""
import re
import subprocess
import sys
import tempfile

NAMED_WELL = r"Compound .* is not documented|Dual<|const RecordedScalar &|Member .* \((variable|enumvalue|typedef)\)|Member .* of (class|struct) "


def shares_a_comment(warning):
    place = re.match(r"(.*\.h):(\d+): warning: Member .* is not documented", warning)
    if not place:
        return False
    above = open(place[1], encoding="utf-8").read().splitlines()[:int(place[2]) - 1]
    while above and above[-1].strip():
        if above.pop().startswith("///"):
            return True
    return False


doxygen, doxyfile = sys.argv[1:]
with tempfile.TemporaryDirectory() as folder:
    settings = open(doxyfile, encoding="utf-8").read() + f"""
OUTPUT_DIRECTORY = "{folder}"
EXTRACT_ALL = NO
GENERATE_HTML = NO
GENERATE_XML = YES
WARN_IF_UNDOCUMENTED = YES
"""
    done = subprocess.run([doxygen, "-"], input=settings, capture_output=True, text=True)
warnings = [line for line in done.stderr.splitlines() if line.strip()]
faults = [line for line in warnings if not re.search(NAMED_WELL, line) and not shares_a_comment(line)]
print("\n".join(faults) or f"doxygen has nothing to say ({len(warnings)} names that need no sentence)")
sys.exit(bool(faults) or done.returncode)
