"""Identikal: Kalman filters tuned and models fitted to recordings, with errors and a verdict.

    import numpy as np, identikal as ik
    y = np.loadtxt("nile.csv", delimiter=",", skiprows=1)[:, -1]
    m = ik.LinearModel(A=[[1.0]], C=[[1.0]], Q=[[ik.p("q", 1000, min=0)]], R=[[ik.p("r", 1000, min=0)]],
                       initial="diffuse", step=1.0)
    f = ik.tune(m, y)
    print(f.summary())
"""

from . import _identikal
from ._errors import FindingWarning, IdentikalError, InputError, StoppedWarning
from .expressions import Expression, p
from .extended import extended_filter
from .external import tune_external
from .fleets import Fleet, PopulationParameter, fleet
from .jobs import (bound, check, compare, filter, fit, forecast, handling, model, shape, simulate, smooth, track, tune,
                   validate)
from .models import Car, FormulaModel, LinearModel, Model, free
from .one_by_one import each
from .online import OnlineFilter
from .results import Finding, Parameter, Result
from .samples import Recording

__version__ = _identikal.version
__all__ = ["Car", "Expression", "Finding", "FindingWarning", "Fleet", "FormulaModel", "IdentikalError", "InputError", "LinearModel",
           "Model", "OnlineFilter", "Parameter", "PopulationParameter", "Recording", "Result", "StoppedWarning", "bound", "check", "compare", "each", "extended_filter",
           "filter", "fit", "fleet", "forecast", "free", "handling", "model", "p", "shape", "simulate", "smooth", "track", "tune",
           "tune_external", "validate"]
