"""Does the shared library show what symbols.txt lists, and nothing else? symbols_test.py LIBRARY"""
import pathlib
import subprocess
import sys

listed = pathlib.Path(__file__).with_name("symbols.txt").read_text().split()
shown = subprocess.run(["nm", "-D", "--defined-only", sys.argv[1]], check=True, capture_output=True, text=True).stdout
shown = sorted(line.split()[-1] for line in shown.splitlines())
gone, new = sorted(set(listed) - set(shown)), sorted(set(shown) - set(listed))
if gone or new:
    sys.exit(f"gone: {gone or 'none'}: programs that use them break\nnew: {new or 'none'}: list them in symbols.txt")
print(f"{len(shown)} symbols, as listed")
