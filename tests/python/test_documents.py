"""The code of docs/python.md gives what stands below it."""
import contextlib
import io
import os
import re

import pytest


def test_python_md(root):
    pytest.importorskip("pandas")
    text = (root / "docs/python.md").read_text()
    scope, here = {}, os.getcwd()
    os.chdir(root)
    try:
        for code, expected in re.findall(r"```python\n(.*?)```\n(?:\n((?:    [^\n]*\n)+))?", text, re.S):
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, "docs/python.md", "exec"), scope)  # noqa: S102
            wanted = "".join(line[4:] for line in expected.splitlines(keepends=True))
            assert said.getvalue() == wanted, code
    finally:
        os.chdir(here)


def test_stubs_name_what_there_is(root):
    import identikal as ik
    stub = (root / "python/identikal/__init__.pyi").read_text()
    for name in ik.__all__:
        assert re.search(rf"^(class|def) {name}\b|\b{name} =", stub, re.M), name
