"""The package that was built lies on PYTHONPATH; IDENTIKAL_TEST_WITHOUT=pandas,matplotlib has these imports fail."""
import os
import pathlib
import sys

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parent.parent.parent
sys.path.insert(0, str(ROOT / "tests/fuzz"))
for name in filter(None, os.environ.get("IDENTIKAL_TEST_WITHOUT", "").split(",")):
    sys.modules[name] = None

import identikal as ik  # noqa: E402



@pytest.fixture(scope="session")
def root():
    return ROOT


@pytest.fixture(scope="session")
def tool():
    return os.environ["IDENTIKAL_TOOL"]


@pytest.fixture(scope="session")
def flow():
    """The Nile, a hundred years."""
    return np.loadtxt(ROOT / "data/nile.csv", delimiter=",", skiprows=1)[:, -1]


@pytest.fixture(scope="session")
def level():
    return ik.LinearModel(A=[[1.0]], C=[[1.0]], G=[[1.0]], Q=[[ik.p("q", 1000, min=0)]],
                          R=[[ik.p("r", 1000, min=0)]], initial="diffuse", step=1.0)


@pytest.fixture(scope="session")
def tuned(level, flow):
    return ik.tune(level, flow)
