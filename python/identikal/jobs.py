"""The verbs of the command line as functions."""

import contextlib
import functools
import json
import os
import sys
import warnings

import numpy as np

from . import _identikal
from ._errors import FindingWarning, IdentikalError, InputError, StoppedWarning
from .models import Model
from .results import Result
from .samples import recordings, with_columns

# Keywords that say yes where the command line says no.
_NEGATED = {"profiles": "no-profiles"}


def _options(given):
    """Keywords as the command line's long options, in JSON."""
    if not given:
        return "{}"
    try:
        return _cached_options(tuple(given.items()), tuple(map(type, given.values())))
    except TypeError:  # a list or a dict among them
        return _options_of(given.items())


@functools.lru_cache(maxsize=64)
def _cached_options(items, types):  # types: 1 and True are equal
    return _options_of(items)


def _options_of(items):
    out = {}
    for keyword, value in items:
        name = keyword.rstrip("_").replace("_", "-")
        if value is None:
            continue
        if name in _NEGATED:
            name, value = _NEGATED[name], not value
        if name == "set" and isinstance(value, dict):
            value = [f"{key}={float(each)!r}" if isinstance(each, (float, np.floating)) else f"{key}={each}" for key, each in value.items()]
        if isinstance(value, os.PathLike):
            value = os.fspath(value)
        if isinstance(value, (np.generic, np.ndarray)):
            value = value.tolist()
        if isinstance(value, tuple):
            value = list(value)
        out[name] = value
    try:
        return json.dumps(out, allow_nan=False)
    except (TypeError, ValueError) as error:
        raise InputError(f"an option that is neither text nor number: {error}") from None


class _Line:
    """Progress as a line of the terminal."""

    def __call__(self, what, share, value):
        sys.stderr.write(f"\r{what[:78]:78}")
        sys.stderr.flush()

    def close(self):
        sys.stderr.write("\r" + " " * 78 + "\r")


class _Bar:
    """Progress as a bar of tqdm."""

    def __init__(self, tqdm):
        self.bar = tqdm(total=1.0, bar_format="{desc} {percentage:3.0f} %|{bar}| {elapsed}")

    def __call__(self, what, share, value):
        self.bar.set_description(what, refresh=False)
        self.bar.n = self.bar.n if share != share else min(share, 1.0)
        self.bar.refresh()

    def close(self):
        self.bar.close()


@contextlib.contextmanager
def showing(progress):
    """What the module calls while it works; a line or a bar goes when it ends."""
    if progress is not True:
        if not (progress is None or progress is False or callable(progress)):
            raise InputError(f"a {type(progress).__name__} as progress; expected True or a function (what, share, value)")
        yield progress or None
        return
    try:
        from tqdm.auto import tqdm
    except ImportError:
        shown = _Line()
    else:
        shown = _Bar(tqdm)
    try:
        yield shown
    finally:
        shown.close()


def _concluded(raw, stopped, model, warn, level):
    """The result, or the exception that its code is."""
    if stopped and raw.code in (2, 5):
        raise KeyboardInterrupt  # before there was anything
    if raw.code == 2:
        raise InputError(raw.message)
    if raw.code == 5:
        raise MemoryError(raw.message) if raw.message == "out of memory" else IdentikalError(raw.message)
    result = Result(raw, model)
    if stopped:
        warnings.warn("stopped; the result is the best so far", StoppedWarning, stacklevel=level)
    if warn and raw.has_warnings():
        for finding in result.findings:
            if finding.severity != "note":
                warnings.warn(str(finding), FindingWarning, stacklevel=level)
    return result


def _model(given):
    """A Model; of a result the one with its estimates."""
    if isinstance(given, Result):
        return given.tuned_model
    if isinstance(given, (str, os.PathLike)):
        return Model(given)
    if not isinstance(given, Model):
        raise InputError(f"a {type(given).__name__} as a model; expected LinearModel, FormulaModel, Car, Model, or a path")
    return given


def _with_truth(model, data, of_recording, truth):
    """The model with references to states that are known, and the recording that has them."""
    model = _model(model)
    try:
        outputs, inputs, states = _identikal.channels(*model._given())
    except ValueError as error:
        raise InputError(str(error)) from None
    if not isinstance(truth, dict):
        truth = np.asarray(truth, dtype=float)
        columns = truth[:, None] if truth.ndim == 1 else truth
        if columns.ndim != 2 or columns.shape[1] != len(states):
            raise InputError(f"truth is {' x '.join(map(str, truth.shape))}; expected rows x {len(states)}, a column for each "
                             f"of {', '.join(states)}, or a dict of some")
        truth = dict(zip(states, columns.T))
    unknown = set(truth) - set(states)
    if unknown or not truth:
        raise InputError(f"truth of '{sorted(unknown)[0] if unknown else 'nothing'}'; expected some of {', '.join(states)}")
    named = {f"truth of {name}": values for name, values in truth.items()}
    references = {name: {"column": f"truth of {name}"} for name in truth}
    text = model.text.rstrip("\n") + f"\nreference: {json.dumps(references)}\n"
    return Model.from_text(text), with_columns(data, of_recording, outputs, inputs, named)


def _run(verb, model, data, of_recording, previous, options, progress, warn, level=4):
    truth = options.pop("truth", None)
    if truth is not None:
        model, data = _with_truth(model, data, of_recording, truth)
        of_recording = (None,) * 5
    if isinstance(model, Result) and verb in ("filter", "forecast", "simulate"):
        previous, model = [model], model.model
    models = [] if model is None else [_model(each) for each in (model if isinstance(model, list) else [model])]
    given, files = recordings(data, *of_recording)
    arguments = verb, [each._given() for each in models], given, files, [each._raw for each in previous], _options(options)
    if progress is None:
        raw, stopped = _identikal.run(*arguments, None)
    else:
        with showing(progress) as shown:
            raw, stopped = _identikal.run(*arguments, shown)
    return _concluded(raw, stopped, models[0] if models else None, warn, level)


_ARGUMENTS = """
    data      an array (rows, or rows x outputs), a pandas DataFrame or Series, a Recording, the path of a file, or a list
              of such (of arrays, not of numbers): several recordings
    u, time, step, columns, units  of one array, as Recording has them
    truth     tune, fit, check, filter: known states, {name: values} or rows x states, SI; no filter sees them, and
              result.references says how far the estimates are from them
    progress  True: a bar (tqdm) or a line; or a function (what, share, value) that returns False to stop
    warn      False: findings are in result.findings and no warnings
    options   those of the command line, with _ for -: starts=1, hold_out="30%", profiles=False, set={"q": 1000}

Ctrl-C stops with the best so far. Raises InputError for a mistake in arguments, model or data. Other threads run
meanwhile."""


def _job(verb, text):
    def run(model, data=None, *, u=None, time=None, step=None, columns=None, units=None, progress=None, warn=True, **options):
        return _run(verb, model, data, (u, time, step, columns, units), [], options, progress, warn)
    run.__name__ = run.__qualname__ = verb
    run.__doc__ = text + "\n" + _ARGUMENTS
    return run


tune = _job("tune", "Estimates the noise covariances Q and R of a Kalman filter, and whatever else is free in its model.")
fit = _job("fit", "Estimates the physical parameters of a car or of a model of formulas.")
check = _job("check", "Tests whether the filter, as it is, is optimal for the recordings. Of a tuned result: that filter.")
shape = _job("shape", "Looks for the shaping filter of coloured noise and tunes the model that has it.")
track = _job("track", "Follows noise, coefficients or tyres that change during a recording.")
bound = _job("bound", "Says before any data how well a recording would determine what is free: the Cramér-Rao bound.\n"
             "`rows` of them; data, if given, are inputs.")
simulate = _job("simulate", "Draws a recording of the model: result.values, result.columns, result.to_frame(); `rows` of them,\n"
                "`seed`. data, if given, are inputs.")
forecast = _job("forecast", "Continues a recording by the model or a result.")


def filter(model, data=None, *, u=None, time=None, step=None, columns=None, units=None, progress=None, warn=True, **options):
    """States of a model, or of the filter of a result: result.states, result.state_sd."""
    return _run("filter", model, data, (u, time, step, columns, units), [], options, progress, warn)


def smooth(model, data=None, *, u=None, time=None, step=None, columns=None, units=None, progress=None, warn=True, **options):
    """States given the whole recording: filter(..., smooth=True)."""
    return _run("filter", model, data, (u, time, step, columns, units), [], {**options, "smooth": True}, progress, warn)


def validate(result, data, *, u=None, time=None, step=None, columns=None, units=None, progress=None, warn=True, **options):
    """Applies a result to other recordings, nothing re-estimated."""
    _results([result])
    return _run("validate", None, data, (u, time, step, columns, units), [result], options, progress, warn)


def compare(*given, data=None, u=None, time=None, step=None, columns=None, units=None, warn=True, **options):
    """Ranks results of one recording (AIC, BIC, likelihood ratios); with data models, or the filters of results, by their
    likelihood there. An array has the channels of the first."""
    if data is None:
        _results(given)
        return _run("compare", None, None, (None,) * 5, list(given), options, None, warn)
    return _run("compare", [_model(each) for each in given], data, (u, time, step, columns, units), [], options, None, warn)


def model(data, *, u=None, time=None, step=None, columns=None, units=None, progress=None, warn=True, **options):
    """Finds a linear model of recordings alone: model(y, u=u, step=0.01), or of files model("log.csv", input="u", output="y").
    result.model is it, for tune, filter and the others; result.document["black_box"] what was tried, with poles, gains and
    responses. as_="armax", order="1:8", for_="simulation" and others are the options of the command line."""
    return _run("model", None, data, (u, time, step, columns, units), [], options, progress, warn)


def handling(model, data=None, *, u=None, time=None, step=None, columns=None, units=None, warn=True, **options):
    """Understeer gradient, frequency response, step and lane change figures of a car's model, or of a result."""
    previous = [model] if isinstance(model, Result) else []
    return _run("handling", None if previous else model, data, (u, time, step, columns, units), previous, options, None,
                warn)


for _function in (filter, smooth, validate, model, handling):
    _function.__doc__ += "\n" + _ARGUMENTS


def _results(given):
    for each in given:
        if not isinstance(each, Result):
            raise InputError(f"a {type(each).__name__} as a result; expected what tune, fit, check, shape or track gave")
