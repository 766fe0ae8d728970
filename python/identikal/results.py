"""What a job answers with: numbers, tables, text and pages."""

import html
import json
from typing import NamedTuple, Tuple

import numpy as np

from ._errors import InputError

# What differs between two runs of the same job.
_OF_A_RUN = ("timing_s", "version")


def inline_page(page):
    """A page as a frame in a notebook."""
    return (f'<iframe srcdoc="{html.escape(page, quote=True)}" style="width:100%;height:40em;border:0" '
            f'sandbox="allow-scripts"></iframe>')


class Parameter(NamedTuple):
    """An estimate; every number is in `unit`, NaN where there is none."""

    name: str
    value: float
    se: float  # standard error
    interval: Tuple[float, float]  # 95 %
    bound_se: float  # standard error at the Cramér-Rao bound
    unit: str
    verdict: str  # "ok", "poorly_determined", "correlated", "at_bound", "not_identifiable", "untrusted", ...
    start: float
    fixed: bool
    limits: Tuple[float, float]


class Finding(NamedTuple):
    """What was found in a recording, a model or an estimate (docs/troubleshooting.md lists the codes)."""

    severity: str  # "note", "warning", "serious"
    code: str
    text: str
    remedy: str

    def __str__(self):
        return f"{self.severity}: {self.text}" + (f" ({self.remedy})" if self.remedy else "")


class Parameters(dict):
    """Parameters by name; fit.params["q"].value, fit.params.values_by_name()."""

    def values_by_name(self):
        return {name: each.value for name, each in self.items()}


class Result:
    """The result of a job: status, message, params, findings, log_likelihood, matrices (A, B, C, D, G, Q, R, S, K, L, P,
    Sigma), series (time, measured, predicted, innovations, standardised, states, state_sd, ...), and `document`, all that
    `--json` prints. Numbers are those of the command line, to the last digit."""

    def __init__(self, raw, model=None):
        self._raw = raw
        self._model = model
        self._cache = {}

    # -- what happened

    @property
    def verb(self):
        return self._raw.verb

    @property
    def code(self):
        """The exit status of the command line: 0 usable, 1 rejected or untrusted, 3 not converged, 4 strict."""
        return self._raw.code

    @property
    def status(self):
        """"ok", "rejected", "untrusted", "not_converged"; None of simulate, which has none."""
        return self._raw.status() or self.document.get("status", {}).get("code")

    @property
    def ok(self):
        return self._raw.code == 0

    @property
    def message(self):
        """The status and why, in one line."""
        return self._raw.message

    @property
    def findings(self):
        """The warnings of the result, most serious first."""
        if "findings" not in self._cache:
            given = self._raw.findings()
            if given is None:
                given = [(f["severity"], f["code"], f["text"], f.get("remedy", "")) for f in self.document.get("findings", [])]
            self._cache["findings"] = [Finding(*each) for each in given]
        return self._cache["findings"]

    # -- numbers

    @property
    def params(self):
        """Parameter by name: value, se, interval, bound_se, unit, verdict."""
        if "params" not in self._cache:
            given = self._raw.parameters(np.nan)
            if given is None:
                given = map(_stored_parameter, self.document.get("parameters", []))
            self._cache["params"] = Parameters((each[0], Parameter._make(each)) for each in given)
        return self._cache["params"]

    @property
    def log_likelihood(self):
        return self._raw.log_likelihood() if self._raw.has_values() else self._objective("log_likelihood")

    @property
    def aic(self):
        return self._objective("aic")

    @property
    def bic(self):
        return self._objective("bic")

    def _objective(self, key):
        value = (self.document.get("objective") or {}).get(key)
        return float("nan") if value is None else value

    @property
    def document(self):
        """The result as `--json` prints it (docs/file-formats.md)."""
        if "document" not in self._cache:
            text = self._raw.json()
            self._cache["document"] = json.loads(text) if text else {}
        return self._cache["document"]

    def to_dict(self):
        """A copy of `document`."""
        text = self._raw.json()
        return json.loads(text) if text else {}

    @property
    def tests(self):
        """The tests of residuals and innovations: dicts of id, channel, value, interval, p, pass."""
        return self.document.get("tests", [])

    @property
    def references(self):
        """How far states are from those that are known (truth, or a model's reference): dicts of name, rmse, bias, sd
        (what the filter says), nees (1 where that is right), coverage, ..."""
        return self.document.get("references", [])

    def _matrix(self, name):
        if name not in self._cache:
            given = (self.document.get("filter") or {}).get(name)
            if given is None:
                given = ((self.document.get("noise") or {}).get(name) or {}).get("matrix") if name in "QRS" else None
            self._cache[name] = None if given is None else np.array(given, dtype=float)
        return self._cache[name]

    @property
    def correlation(self):
        """Of the estimates, in the order of correlation_names; None where there is none."""
        given = self.document.get("correlation")
        return np.array(given["matrix"], dtype=float) if given and given.get("matrix") else None

    @property
    def correlation_names(self):
        return list((self.document.get("correlation") or {}).get("names", []))

    def series(self, name):
        """A row per sample, not to be written to, in the channels' units; states and state_sd in SI. None where the
        result has no such series; `series_names` lists those that it has."""
        values = self._raw.series(name)
        return values[:, 0] if values is not None and name == "time" else values

    @property
    def series_names(self):
        return self._raw.series_names()

    @property
    def values(self):
        """Of simulate and forecast: a row per sample, in the order of `columns`."""
        return self._table()[1]

    @property
    def columns(self):
        """Of simulate and forecast."""
        return self._table()[0]

    def _table(self):
        if "table" not in self._cache:
            lines = [line for line in self._raw.text().splitlines() if not line.startswith("#")]
            if not lines or self._raw.has_document():
                return [], None
            rows = [[float(x) if x else np.nan for x in line.split(",")] for line in lines[1:]]
            self._cache["table"] = lines[0].split(","), np.array(rows)
        return self._cache["table"]

    # -- the filter that was found

    @property
    def model(self):
        """The model that the job ran on."""
        if self._model is None:
            from .models import Model
            text = (self.document.get("model_file") or {}).get("text")
            self._model = Model.from_text(text) if text else None
        return self._model

    @property
    def tuned_model(self):
        """The model with the estimates in place of its starts: export("yaml")."""
        from .models import Model
        return Model.from_text(self.export("yaml"))

    def online_filter(self):
        """The tuned filter, one sample after the other (OnlineFilter)."""
        from .online import OnlineFilter
        return OnlineFilter(self)

    def export(self, to):
        """The result as text to paste: "cpp", "c", "matlab", "python", "yaml" or "json"."""
        try:
            return self._raw.export(to)
        except ValueError as error:
            raise InputError(str(error)) from None

    # -- text, tables, pages

    def summary(self):
        """What the command line prints."""
        return self._raw.summary() or self._raw.text()

    def report(self):
        """One HTML page with every plot, which needs no network; empty where a verb has none. The first time the job
        runs again for its pictures."""
        return self._raw.page()

    def _repr_html_(self):
        page = self.report() if self._raw.has_document() else ""
        if not page:
            return f"<pre>{html.escape(self.summary() or self.message)}</pre>"
        return inline_page(page)

    def to_frame(self):
        """A pandas DataFrame: of simulate and forecast the samples, of others the parameters by name."""
        import pandas
        if not self._raw.has_document() and self.values is not None:
            return pandas.DataFrame(self.values, columns=self.columns)
        rows = [{"value": p.value, "se": p.se, "low": p.interval[0], "high": p.interval[1], "bound_se": p.bound_se,
                 "unit": p.unit, "verdict": p.verdict} for p in self.params.values()]
        return pandas.DataFrame(rows, index=pandas.Index(list(self.params), name="parameter"),
                                columns=["value", "se", "low", "high", "bound_se", "unit", "verdict"])

    def plot(self):
        """Measured and predicted outputs and the innovations, by matplotlib. Gives its Figure."""
        from matplotlib.figure import Figure
        time, measured, predicted = (self.series(name) for name in ("time", "measured", "predicted"))
        if time is None or measured is None:
            raise InputError(f"a result of {self.verb} without series; expected one of tune, fit, check, filter")
        names = [each["name"] for each in (self.document.get("filter") or {}).get("outputs", [])]
        figure = Figure(figsize=(8, 2.5 * (measured.shape[1] + 1)), layout="constrained")
        axes = figure.subplots(measured.shape[1] + 1, sharex=True)
        for i, axis in enumerate(axes[:-1]):
            axis.plot(time, measured[:, i], ".", label="measured", markersize=3)
            axis.plot(time, predicted[:, i], label="predicted")
            axis.set_ylabel(names[i] if i < len(names) else f"y{i + 1}")
            axis.legend()
        axes[-1].plot(time, self.series("innovations"), linewidth=0.8)
        axes[-1].set_ylabel("innovations")
        axes[-1].set_xlabel("time [s]")
        return figure

    def __str__(self):
        return self.summary()

    def __repr__(self):
        return f"<identikal {self.verb}: {self.message}>"

    # -- as a value

    def _said(self):
        said = {key: value for key, value in self.document.items() if key not in _OF_A_RUN}
        return self.verb, self.code, said, self._raw.text()

    def __eq__(self, other):
        if not isinstance(other, Result):
            return NotImplemented
        return self is other or self._said() == other._said()

    __hash__ = None

    def __copy__(self):
        return Result(self._raw, self._model)

    def __deepcopy__(self, memo):
        return Result(self._raw, self._model)

    def __getstate__(self):
        return {"raw": self._raw.state(), "model": self._model}

    def __setstate__(self, state):
        from . import _identikal
        self.__init__(_identikal.restored(state["raw"]), state["model"])


def _stored_parameter(p):
    def number(value):
        return np.nan if value is None else value
    low, high = p["bounds"]
    ends = list(p["ci95"] or (None, None))
    if ends != [None, None]:  # where one end alone is not known there is none
        ends = (-np.inf if ends[0] is None else ends[0], np.inf if ends[1] is None else ends[1])
    return (p["name"], number(p["value"]), number(p["se"]), tuple(map(number, ends)),
            number(p["crb_se"]), p["unit"], p["verdict"], number(p["start"]), p["fixed"],
            (-np.inf if low is None else low, np.inf if high is None else high))


def _matrix_property(name, text):
    return property(lambda self: self._matrix(name), doc=text + "; None where the result has none.")


def _series_property(name, text):
    return property(lambda self: self.series(name), doc=text + "; None where the result has none.")


for _name, _text in {"A": "n x n", "B": "n x inputs", "C": "outputs x n", "D": "outputs x inputs", "G": "n x process noises",
                     "Q": "Covariance of the process noise", "R": "Covariance of the measurement noise",
                     "S": "Cross-covariance of process and measurement noise", "K": "Steady gain of the predictor, n x outputs",
                     "L": "Steady gain of the filter, n x outputs", "P": "Steady covariance of the prediction, n x n",
                     "Sigma": "Steady covariance of the innovations"}.items():
    setattr(Result, _name, _matrix_property(_name, _text))
for _name, _text in {"time": "[s], a number per sample", "measured": "rows x outputs", "predicted": "One step ahead, rows x outputs",
                     "innovations": "measured - predicted, rows x outputs", "standardised": "Innovations over their deviation",
                     "states": "Of filter: rows x states, SI", "state_sd": "Of filter: rows x states, SI",
                     "tracked": "Of track: noise, coefficients or tyres", "tracked_sd": "Of track"}.items():
    setattr(Result, _name, _series_property(_name, _text))
