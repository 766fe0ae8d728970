"""A filter that somebody wrote in Python, tuned."""

import numbers

import numpy as np

from . import _identikal
from ._errors import InputError
from .jobs import _concluded, showing


def tune_external(filter, start, data=None, *, limits=None, iterations=None, progress=None, warn=True):
    """Maximum likelihood of the innovations of any filter over its parameters, with standard errors and tests of the
    innovations (size and whiteness).

    filter  f(theta, data), or f(theta) without data: gives innovations (rows, or rows x outputs; NaN where an output is
            missing) and their covariances (a number or a number per row; outputs x outputs; rows x outputs x outputs),
            or None where it does not run. Smooth in theta: no random numbers, the same rows used
    start   {name: value}, and theta is a dict; or numbers, and theta is an array
    limits  {name: (least, greatest)}, or a pair for each number; None: no limit

    An iteration runs the filter twice for each parameter. Ctrl-C stops with the best so far.

        fit = tune_external(my_ekf, {"q": 1.0, "r": 1.0}, y, limits={"q": (0, None), "r": (0, None)})
    """
    names, values, theta_of = _start(start)
    box = _limits(limits, names)
    if not callable(filter):
        raise InputError(f"a {type(filter).__name__} as a filter; expected a function of theta and data")

    def run(numbers):
        answer = filter(theta_of(numbers)) if data is None else filter(theta_of(numbers), data)
        return None if answer is None else _innovations(answer)

    with showing(progress) as shown:
        raw, stopped = _identikal.tune_external(list(zip(names, values, *zip(*box))), run, iterations or 0, shown)
    return _concluded(raw, stopped, None, warn, 3)


def _start(start):
    if isinstance(start, dict):
        names, values = [str(name) for name in start], list(start.values())
        theta_of = lambda at: dict(zip(names, at.tolist()))  # noqa: E731
    else:
        values = np.atleast_1d(_numbers("start", start)).tolist()
        names = [f"theta{i + 1}" for i in range(len(values))]
        theta_of = np.array
    for name, value in zip(names, values):
        if not isinstance(value, (numbers.Real, np.number)) or not np.isfinite(value):
            raise InputError(f"'{name}' starts at {value!r}; expected a finite number")
    if not names:
        raise InputError("no parameters; expected one at least")
    return names, [float(value) for value in values], theta_of


def _numbers(what, given):
    try:
        return np.asarray(given, dtype=float)
    except (TypeError, ValueError) as error:
        raise InputError(f"{what}: {error}; expected numbers") from None


def _limits(limits, names):
    if limits is None:
        limits = {}
    if not isinstance(limits, dict):
        limits = dict(zip(names, limits))
    unknown = set(limits) - set(names)
    if unknown:
        raise InputError(f"limits of '{sorted(unknown)[0]}', which is no parameter; expected one of {', '.join(names)}")
    out = []
    for name in names:
        pair = limits.get(name) or (None, None)
        if not isinstance(pair, (tuple, list)) or len(pair) != 2:
            raise InputError(f"limits of '{name}' are {pair!r}; expected (least, greatest), None where there is none")
        least, greatest = pair
        out.append((-np.inf if least is None else float(_numbers("limits", least)),
                    np.inf if greatest is None else float(_numbers("limits", greatest))))
    return out


def _innovations(answer):
    if not isinstance(answer, (tuple, list)) or len(answer) != 2:
        raise InputError("a filter that does not return two arrays; expected innovations and their covariances")
    e = np.ascontiguousarray(_numbers("innovations", answer[0]))
    S = _numbers("covariances", answer[1])
    if e.ndim == 1:
        e = e[:, None]
    if e.ndim != 2:
        raise InputError(f"innovations of {e.ndim} dimensions; expected rows, or rows x outputs")
    if S.ndim == 0:
        S = S.reshape(1, 1)
    if S.ndim == 1 and e.shape[1] == 1:
        S = S.reshape(-1, 1, 1)
    return e, np.ascontiguousarray(S)
