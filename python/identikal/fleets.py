"""One verb on many recordings, by processes of their own, with a store that remembers what is done."""

import collections
import csv
import io
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import warnings
from typing import Dict, List, NamedTuple, Tuple

import numpy as np

from . import _identikal
from ._errors import IdentikalError, InputError, StoppedWarning
from .jobs import _model, _options, showing
from .results import Result, inline_page
from .samples import is_frame, _is_recording, _recording

_VERBS = ("tune", "fit", "check", "validate")
# Columns of a manifest that are no covariates.
_OF_MANIFEST = ("recording", "unit", "group", "options", "where")
_TEXTS = {"recording", "unit", "group", "options", "where", "status", "findings", "message"}


class PopulationParameter(NamedTuple):
    """What the units of a fleet have in common in one parameter. Where `logarithm`, mean, spread and trends are of the
    logarithm; `typical` and its interval are in the parameter's unit."""

    name: str
    unit: str
    logarithm: bool
    typical: float
    interval: Tuple[float, float]  # 95 %, of the mean
    spread: float  # standard deviation between units, beyond their errors
    spread_interval: Tuple[float, float]  # 95 %
    p_same: float  # of the test that all units are the same
    units: Dict[str, float]  # estimates, by unit
    strangers: List[str]  # units that do not belong: on average at most 5 % of them are named wrongly
    trends: List[dict]  # with covariates: covariate, slope, se, p


class Fleet:
    """A fleet's store: rows of results in the order of the recordings, and what they have in common.

        fleet = Fleet("drives.store")
        fleet["q"], fleet["q_se"], fleet["status"]      # a number or a text for each row
    """

    def __init__(self, store):
        self.path = os.fspath(store)
        self._folder = None  # of a store that was not named: goes with this
        self._table = None
        self._read("status")

    # -- what came out

    @property
    def columns(self):
        """Of the table that `identikal fleet export` prints: recording, unit, group, status, exit_code, rows,
        log_likelihood, every parameter with _se, _low, _high, fits, tests, findings, message."""
        return self._rows()[0]

    def __getitem__(self, column):
        """A column: an array of numbers, NaN where a row has none, or a list of texts."""
        names, rows = self._rows()
        if column not in names:
            raise InputError(f"no column '{column}' in {self.path}; expected one of {', '.join(names)}")
        at = names.index(column)
        values = [row[at] for row in rows]
        if column in _TEXTS:
            return values
        try:
            return np.array([float(value) if value else np.nan for value in values])
        except ValueError:
            return values

    def __len__(self):
        return len(self._rows()[1])

    @property
    def statuses(self):
        """{"ok": 190, "untrusted": 8, "failed": 2}"""
        return dict(collections.Counter(self["status"]))

    @property
    def complete(self):
        """Every recording is done."""
        status = json.loads(self._read("status"))
        return status["done"] == status["recordings"]

    @property
    def failed(self):
        """{recording: why} of those that could not be done."""
        return {name: why for name, status, why in zip(self["recording"], self["status"], self["message"]) if status == "failed"}

    def population(self):
        """PopulationParameter by name: the second stage of a two-stage analysis (docs/fleets.md)."""
        return {each["name"]: _population_parameter(each) for each in json.loads(self._read("population"))["parameters"]}

    # -- text, tables, pages

    def summary(self):
        """What `identikal fleet status` prints."""
        return self._read("summary")

    def export(self, path=None):
        """The table as CSV, the same whoever did the work; into a file where a path is given."""
        text = self._read("table")
        if path is None:
            return text
        with open(path, "w", encoding="utf-8", newline="") as file:
            file.write(text)
        return None

    def to_frame(self):
        """A pandas DataFrame, a row for each recording, or part of one."""
        import pandas
        return pandas.DataFrame({name: self[name] for name in self.columns}).set_index("recording")

    def report(self):
        """One HTML page: distributions, units that do not belong, trends."""
        return self._read("page")

    def _repr_html_(self):
        return inline_page(self.report())

    def __str__(self):
        return self.summary()

    def __repr__(self):
        said = ", ".join(f"{count} {status}" for status, count in self.statuses.items())
        return f"<identikal fleet {self.path}: {said or 'nothing is done'}>"

    # -- going on

    def resume(self, *, progress=None, **options):
        """Does what is not done, or has changed. Options are those of `identikal fleet resume`: workers=2, timeout=60."""
        self._table = None
        _work(["fleet", "resume", self.path, *_words(options)], self.path, progress)
        return self

    def _rows(self):
        if self._table is None:
            lines = list(csv.reader(io.StringIO(self._read("table"))))
            self._table = lines[0], lines[1:]
        return self._table

    def _read(self, what):
        try:
            return _identikal.fleet_text(self.path, what)
        except ValueError as error:
            raise InputError(str(error)) from None


def fleet(verb, model, recordings, store=None, *, progress=None, **options):
    """One verb on each of many recordings, on all cores, each in a process that may end without harm to the others.

    verb        "tune", "fit", "check" or "validate"
    model       as for the verb; a Result for "validate"
    recordings  a path, a folder, a pattern ("drives/*.csv"), or a list of recordings: paths, arrays, tables, Recordings;
                {unit: recording}; or rows with what else is known of each, as a list of dicts or a DataFrame:
                {"recording": path or samples, "name": of samples, "unit": ..., "group": ..., "options": ..., "where": ...,
                and covariates}
    store       path of the results, a SQLite database. What is in it already and still holds is not done again. Samples and
                models that are not files are kept next to it. Without it the results go with the object.
    progress    True: a bar (tqdm) or a line; or a function (what, share, value) that returns False to stop
    options     those of `identikal fleet VERB`: workers=2, timeout=60, retries=3, by="vehicle", starts=1, engine="slurm"

    Gives a Fleet. Ctrl-C stops with what is done and a StoppedWarning; the same call, or resume(), goes on.

        result = fleet("tune", model, [y1, y2, y3])
        result["q"], result.population()["q"].typical
    """
    if verb not in _VERBS:
        raise InputError(f"a fleet of '{verb}'; expected one of {', '.join(_VERBS)}")
    folder = None
    if store is None:
        folder = tempfile.TemporaryDirectory(prefix="identikal-fleet-")
        store = os.path.join(folder.name, "fleet.store")
    store = os.fspath(store)
    words = _words(options)
    try:
        os.makedirs(os.path.dirname(os.path.abspath(store)), exist_ok=True)
        text_of_model, path_of_model, said = _model_file(verb, model, store)
        manifest = _manifest(recordings, store, text_of_model, path_of_model)
    except OSError as error:
        raise IdentikalError(f"{error.filename}: {error.strerror}") from None
    _work(["fleet", verb, said, manifest, "-o", store, *words], store, progress)
    out = Fleet(store)
    out._folder = folder
    return out


def _model_file(verb, model, store):
    """The model as text or path, one of them empty, and the path that the verb is to read."""
    if verb == "validate":
        if not isinstance(model, Result):
            raise InputError(f"a {type(model).__name__} for a fleet of 'validate'; expected what tune, fit, check, shape or track gave")
        return *model.model._given(), _keep(store + ".result.json", model._raw.json())
    model = _model(model)
    text, path = model._given()
    return text, path, path or _keep(store + ".model.yaml", text)


def _keep(path, text):
    """The file with this text; one that has it already keeps its time."""
    try:
        with open(path, encoding="utf-8", newline="") as file:
            if file.read() == text:
                return path
    except (OSError, UnicodeDecodeError):
        pass
    with open(path, "w", encoding="utf-8", newline="") as file:
        file.write(text)
    return path


def _manifest(given, store, text_of_model, path_of_model):
    """What the verb takes for its recordings: a path as it was given, else a file that lists them."""
    if isinstance(given, (str, os.PathLike)):
        return os.fspath(given)
    rows = _manifest_rows(given)
    if not rows:
        raise InputError("a fleet without recordings; expected one at least")
    columns = ["recording", *sorted({key for row in rows for key in row if key in _OF_MANIFEST[1:]}, key=_OF_MANIFEST.index)]
    columns += [key for key in dict.fromkeys(key for row in rows for key in row) if key not in columns and key != "name"]
    folder = os.path.dirname(store)
    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    taken = set()
    for number, row in enumerate(rows, 1):
        name = str(row.get("name", number))
        path = _recording_file(row["recording"], name, taken, store, text_of_model, path_of_model)
        writer.writerow([_seen_from(folder, path) if key == "recording" else _cell(row.get(key)) for key in columns])
    return _keep(store + ".manifest.csv", out.getvalue())


def _seen_from(folder, path):
    """A path, or several joined by '+', relative to the folder."""
    return "+".join(os.path.relpath(each, folder or ".") for each in path.split("+"))


def _manifest_rows(given):
    """A dict for each recording."""
    if is_frame(given) and given.ndim == 2 and "recording" in given.columns:
        given = given.to_dict("records")
    if isinstance(given, dict):
        return [{"recording": each, "name": name, "unit": name} for name, each in given.items()]
    if isinstance(given, (list, tuple)) or hasattr(given, "__next__"):
        rows = list(given)
        if any(isinstance(each, dict) for each in rows):
            for number, each in enumerate(rows, 1):
                if not isinstance(each, dict) or "recording" not in each:
                    raise InputError(f"row {number} of a fleet has no 'recording'; expected {{'recording': path or samples, ...}}")
            return rows
        if all(_is_recording(each) or isinstance(each, list) for each in rows):
            return [{"recording": each} for each in rows]
    raise InputError(f"a {type(given).__name__} as the recordings of a fleet; expected a path or pattern, a list of paths or samples, "
                     "{name: samples}, or a table with a column 'recording'")


def _recording_file(given, name, taken, store, text_of_model, path_of_model):
    """The recording's file; samples are written, with all their digits."""
    if isinstance(given, (str, os.PathLike)):
        return os.fspath(given)
    if not re.fullmatch(r"[^\W.][^/\0+]*", name) or name in taken:
        raise InputError(f"'{name}' as the name of a recording; expected one for each that can be the name of a file and has no '+'")
    taken.add(name)
    try:
        text = _identikal.csv_text(text_of_model, path_of_model, _recording(given, *[None] * 5).handed_over(), name)
    except ValueError as error:
        raise InputError(f"recording '{name}': {error}") from None
    folder = store + ".recordings"
    os.makedirs(folder, exist_ok=True)
    return _keep(os.path.join(folder, name + ".csv"), text)


def _cell(value):
    return "" if value is None or value != value else str(value)


def _words(options):
    """Keywords as words of a command line."""
    out = []
    for name, value in json.loads(_options(options)).items():
        for each in value if isinstance(value, list) else [value]:
            if each is False:
                continue
            out += [f"--{name}"] if each is True else [f"--{name}", str(each)]
    return out


def _work(words, store, progress):
    """The tool in a process of its own: it forks, and this one may have threads."""
    here = os.path.dirname(os.path.dirname(os.path.abspath(__file__)))
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, [here, os.environ.get("PYTHONPATH")]))}
    with showing(progress) as shown, tempfile.TemporaryFile() as said, tempfile.TemporaryFile() as wrong:
        process = subprocess.Popen([sys.executable, "-m", "identikal", *words, "--quiet"], stdin=subprocess.DEVNULL, stdout=said,
                                   stderr=wrong, env=environment, start_new_session=True)
        stopped = _wait(process, store, shown)
        text, remarks = _text_of(said), _text_of(wrong)
    if "--dry-run" in words:
        print(text, end="")
    if stopped:
        warnings.warn("stopped; the store has what is done, and resume() goes on", StoppedWarning, stacklevel=3)
    elif process.returncode < 0:
        raise IdentikalError(f"the fleet was ended by signal {-process.returncode}; the store has what is done")
    elif process.returncode in (2, 5) and not text:  # exit status 2 beside a summary: no recording has a result
        message = re.sub(r"^identikal: ", "", (remarks.splitlines() or ["no message"])[-1])
        raise (InputError if process.returncode == 2 else IdentikalError)(message)


def _text_of(file):
    file.seek(0)
    return file.read().decode(errors="replace")


def _wait(process, store, shown):
    """Until it ends. Gives whether it was stopped before its end."""
    stopped = False
    while True:
        try:
            process.wait(0.2)
            return stopped
        except subprocess.TimeoutExpired:
            if stopped or shown is None:
                continue
            if shown(*_so_far(store)) is False:
                stopped = True
                process.send_signal(signal.SIGINT)
        except KeyboardInterrupt:
            stopped = True
            process.send_signal(signal.SIGINT)


def _so_far(store):
    try:
        status = json.loads(_identikal.fleet_text(store, "counts"))
    except ValueError:  # it has not begun
        return "fleet", float("nan"), float("nan")
    done, all_of_them = status["done"], status["recordings"]
    return f"fleet: {done} of {all_of_them}", done / max(all_of_them, 1), float(done)


def _population_parameter(each):
    def shown(value):
        return float("nan") if value is None else float(np.exp(value)) if each["logarithm"] else float(value)

    def number(value):
        return float("nan") if value is None else float(value)
    return PopulationParameter(
        each["name"], each["unit"], each["logarithm"], shown(each["mean"]), tuple(map(shown, each["interval"])), number(each["sd"]),
        tuple(map(number, each["sd_interval"])), number(each["q_p"]), {unit["unit"]: shown(unit["value"]) for unit in each["units"]},
        [unit["unit"] for unit in each["units"] if not unit["belongs"]], each["trends"])
