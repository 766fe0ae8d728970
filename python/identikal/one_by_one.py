"""A verb on each of many recordings by itself, in this process."""

import itertools
import os
import time
import warnings

from . import _identikal
from ._errors import InputError, StoppedWarning
from .jobs import _model, _options, showing
from .results import Result
from .samples import is_frame, recordings

_VERBS = ("tune", "fit", "check", "shape", "track", "filter", "forecast", "validate", "model")
# Recordings in one call of the module: few enough for results to come soon and memory to stay flat, enough for its cost to vanish.
_SHORTEST, _MOST = 0.2, 256  # seconds; recordings a thread


def each(verb, model, recordings, *, step=None, columns=None, units=None, threads=None, progress=None, **options):
    """Runs a verb on each recording by itself and yields the results in the order of the recordings.

    verb        "tune", "fit", "check", "shape", "track", "filter", "forecast", "validate", "model"
    model       what the verb takes: a model, or a Result (validate always; filter and forecast: with its estimates); None for "model"
    recordings  a list or an iterator of arrays, Recordings, tables or paths; of a two-dimensional array each row is one, of a table
                each column; an item that is a list of recordings is one task: they are fitted together
    threads     as many recordings at a time; all processors. Results do not depend on it
    progress    True: a bar (tqdm) or a line; or a function (what, share, value) that returns False to stop
    options     as the verb has them

    A recording that cannot be used has a result with code 2 and the reason as its message; findings are in result.findings and no
    warnings. Ctrl-C ends it, with KeyboardInterrupt, behind the results that are done. `fleet` does the same in processes of
    their own, and keeps what is done.

        q = [fit.params["q"].value for fit in identikal.each("tune", model, series) if fit.ok]
    """
    if verb not in _VERBS:
        raise InputError(f"'{verb}' on each recording; expected one of {', '.join(_VERBS)}")
    previous = [model] if isinstance(model, Result) and verb in ("filter", "forecast", "validate") else []
    if verb == "validate" and not previous:
        raise InputError(f"a {type(model).__name__} to validate; expected what tune or fit gave")
    if verb == "model" and model is not None:
        raise InputError("'model' with a model; expected None: it finds the model")
    if previous and verb != "validate":
        model = previous[0].model
    models = [] if verb in ("validate", "model") else [_model(model)]
    call = verb, [one._given() for one in models], [one._raw for one in previous], _options(options)
    try:
        _identikal.check_call(call[0], call[1], call[3])
    except ValueError as error:
        raise InputError(str(error)) from None
    return _results(call, models[0] if models else None, _items(recordings), (None, None, step, columns, units), _threads(threads),
                    progress)


def _threads(given):
    if given is None:
        return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    if not isinstance(given, int) or isinstance(given, bool) or not 1 <= given <= 1024:
        raise InputError(f"threads={given!r}; expected a number from 1 to 1024")
    return given


def _items(given):
    if is_frame(given) and given.ndim == 2:
        return [given.iloc[:, i].rename(None) for i in range(given.shape[1])]
    if isinstance(given, (str, bytes, os.PathLike, dict)) or not hasattr(given, "__iter__") or getattr(given, "ndim", 2) < 2:
        more = ", its values()" if isinstance(given, dict) else ", [y] for one alone" if getattr(given, "ndim", 0) == 1 else ""
        raise InputError(f"a {type(given).__name__} as recordings; expected a list of arrays, Recordings, tables or paths{more}")
    return given


def _handed_over(item, of_recording):
    """Samples and files of one task; or the result of what is no recording."""
    try:
        given, files = recordings(item, *of_recording)
    except InputError as error:
        return str(error)
    return (given, files) if given or files else f"a {type(item).__name__} as a recording; expected samples"


def _results(call, model, items, of_recording, threads, progress):
    verb, models, previous, options = call
    total = len(items) if hasattr(items, "__len__") else None
    items = iter(items)
    done, size = 0, threads
    with showing(progress) as shown:
        while True:
            given = [_handed_over(item, of_recording) for item in itertools.islice(items, size)]
            if not given:
                return
            begin = time.monotonic()
            raw, stopped = _identikal.run_each(verb, models, [one for one in given if not isinstance(one, str)], previous, options, threads)
            if time.monotonic() - begin < _SHORTEST:
                size = min(2 * size, _MOST * threads)
            raw = iter(raw)
            finished = [_identikal.failed(verb, one) if isinstance(one, str) else next(raw) for one in given]
            for one in finished:
                if one is not None:
                    yield Result(one, model)
            if stopped:
                raise KeyboardInterrupt
            done += len(given)
            of = "" if total is None else f" of {total}"
            if shown and shown(f"{done}{of} recordings", done / total if total else float("nan"), float("nan")) is False:
                if done != total:
                    warnings.warn(f"stopped after {done}{of} recordings", StoppedWarning, stacklevel=2)
                return
