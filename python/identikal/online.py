"""A filter that takes one sample after the other."""

import numpy as np

from . import _identikal
from ._errors import InputError
from .models import Model
from .results import Result


class OnlineFilter:
    """The Kalman filter of a result or of a linear model whose step is given, one sample after the other; of a result of
    track the filter that learns its noise, or recursive least squares. Its numbers are those of filter().

        online = OnlineFilter(fit)
        for y in samples:
            state, sd, innovation = online.step(y)     # SI; y: NaN where an output is missing
    """

    def __init__(self, of):
        if not isinstance(of, (Model, Result)):
            raise InputError(f"a {type(of).__name__} as a filter; expected a result or a linear model")
        try:
            self._filter = _identikal.OnlineFilter(of._raw, None) if isinstance(of, Result) else \
                _identikal.OnlineFilter(None, of.text)
        except ValueError as error:
            raise InputError(str(error)) from None

    @property
    def states(self):
        return self._filter.states

    @property
    def inputs(self):
        return self._filter.inputs

    @property
    def outputs(self):
        return self._filter.outputs

    def step(self, y, u=None):
        """Takes a sample. Gives state and sd, given y up to now, and y minus its prediction."""
        try:
            return self._filter.step(np.atleast_1d(np.asarray(y, dtype=float)),
                                     None if u is None else np.atleast_1d(np.asarray(u, dtype=float)))
        except (TypeError, ValueError) as error:
            raise InputError(str(error)) from None
