"""What stands in docs/ about Python is so."""
import contextlib
import io
import json
import os
import re

import pytest


DOCUMENTS = ["python", "tune-a-filter", "is-my-filter-optimal", "coloured-noise", "identify-a-vehicle", "plan-an-experiment",
             "a-model-of-your-own"]


@pytest.mark.parametrize("name", DOCUMENTS)
def test_code_of_documents(root, name):
    """Python of docs/ gives what stands below it."""
    pytest.importorskip("pandas")
    text = (root / f"docs/{name}.md").read_text()
    scope, here = {}, os.getcwd()
    blocks = re.findall(r"```python\n(.*?)```\n(?:\n((?:    [^\n]*\n)+))?", text, re.S)
    assert blocks
    os.chdir(root)
    try:
        for code, expected in blocks:
            said = io.StringIO()
            with contextlib.redirect_stdout(said):
                exec(compile(code, name, "exec"), scope)  # noqa: S102
            assert said.getvalue() == "".join(line[4:] for line in expected.splitlines(keepends=True)), code
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
