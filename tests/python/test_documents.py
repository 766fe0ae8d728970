"""The code of docs/python.md gives what stands below it."""
import contextlib
import io
import json
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


NOTEBOOKS = ["tune_a_filter", "identify_a_vehicle", "my_own_ekf", "battery", "many_recordings"]


@pytest.mark.parametrize("name", NOTEBOOKS)
def test_notebooks_run(root, name):
    """Cell by cell, as a kernel would; tests/install/notebooks.py has Jupyter do it."""
    if name == "battery":
        pytest.importorskip("pandas")
    cells = json.loads((root / f"docs/notebooks/{name}.ipynb").read_text())["cells"]
    scope, here = {}, os.getcwd()
    os.chdir(root / "docs/notebooks")
    try:
        said = io.StringIO()
        with contextlib.redirect_stdout(said):
            for cell in cells:
                if cell["cell_type"] == "code":
                    exec(compile("".join(cell["source"]), name, "exec"), scope)  # noqa: S102
        assert said.getvalue()
        for cell in cells:
            assert not cell.get("outputs"), "notebooks are kept without outputs"
    finally:
        os.chdir(here)
