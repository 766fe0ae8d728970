"""Recordings: arrays, pandas, and files as what the verbs read."""

import os
import re

import numpy as np

from . import _identikal
from ._errors import InputError


class Recording:
    """Samples of one recording, a row per sample; NaN (in a masked array: masked; in a list: None) where one is missing.

    y        rows x outputs, or rows where there is one
    u        rows x inputs, likewise
    time     rows, rising [s], or numpy's datetime64; without it samples are `step` [s] apart, or as the model says
    columns  names of the columns of y, then of u, as the model calls them; without it y and u hold the model's
             channels in its order, in SI
    units    {column: unit} where a column is not in the model's unit

    A pandas DataFrame is such a recording: its columns are the channels, with units where they are called "speed [km/h]" or
    "speed (km/h)", and its index the times, unless that merely counts from 0 on or a column is what the model calls time.

        tune(model, Recording(y, u=u, step=0.1))
    """

    def __init__(self, y=None, *, u=None, time=None, step=None, columns=None, units=None):
        self.y = None if y is None else _rows("y", y)
        self.u = None if u is None else _rows("u", u)
        self.time = None if time is None else times(time)
        self.step = 0.0 if step is None else _step(step)
        self.columns = [] if columns is None else [str(each) for each in columns]
        if self.y is None and self.u is None:
            raise InputError("a recording without samples; expected y, u, or both")
        lengths = {name: len(each) for name, each in (("y", self.y), ("u", self.u), ("time", self.time))
                   if each is not None}
        if len(set(lengths.values())) > 1:
            raise InputError(f"{', '.join(f'{name} has {n} rows' for name, n in lengths.items())}; expected as many in each")
        count = sum(each.shape[1] if each.ndim == 2 else 1 for each in (self.y, self.u) if each is not None)
        if self.columns and len(self.columns) != count:
            raise InputError(f"{len(self.columns)} columns are named and {count} given; expected a name for each")
        if units and not self.columns:
            raise InputError("units without columns; expected columns=['r', ...] beside units={'r': 'deg/s'}")
        unknown = set(units or {}) - set(self.columns)
        if unknown:
            raise InputError(f"a unit for '{sorted(unknown)[0]}', which is no column; expected one of "
                             f"{', '.join(self.columns)}")
        self.units = [(units or {}).get(name) for name in self.columns] if units else []

    @classmethod
    def of_frame(cls, frame, units=None, step=None):
        """A pandas DataFrame or Series: columns that hold no numbers are left out."""
        if frame.ndim == 1:
            frame = frame.to_frame(frame.name if frame.name is not None else "y")
        numbers = [i for i, kind in enumerate(frame.dtypes) if getattr(kind, "kind", "O") in "fiub"]
        numbers += [i for i, kind in enumerate(frame.dtypes) if i not in numbers and _is_numeric(frame.iloc[:, i])]
        numbers.sort()
        if not numbers:
            raise InputError("a table without numbers; expected columns of numbers")
        headers = [_name_and_unit(str(frame.columns[i])) for i in numbers]
        columns = [name for name, _ in headers]
        unknown = set(units or {}) - set(columns)
        if unknown:
            raise InputError(f"a unit for '{sorted(unknown)[0]}', which is no column of numbers; expected one of "
                             f"{', '.join(columns)}")
        values = frame.iloc[:, numbers].to_numpy(dtype=float, na_value=np.nan)
        return cls(values, time=_index_times(frame.index), step=step, columns=columns,
                   units={**{name: unit for name, unit in headers if unit}, **(units or {})})

    def handed_over(self):
        return (self.time, self.y, self.u, self.step, self.columns, self.units)


def _name_and_unit(header):
    """As the reader of CSV files takes a header."""
    parts = re.fullmatch(r"(.*\S)\s*[\[(]([^\])]*)[\])]\s*", header)
    if not parts:
        return header, None
    return parts[1], parts[2] if _identikal.is_unit(parts[2]) else None


def _is_numeric(column):
    """Numbers of pandas' own types, or objects that are numbers and None."""
    if column.dtype.kind == "O" and not hasattr(column.dtype, "numpy_dtype"):
        return column.map(lambda x: x is None or isinstance(x, (int, float, np.number))).all()
    return getattr(getattr(column.dtype, "numpy_dtype", None), "kind", "O") in "fiub"


def _index_times(index):
    if type(index).__name__ == "RangeIndex" or index.dtype.kind not in "fiuMm":
        return None
    return times(index.to_numpy()) if index.dtype.kind != "M" else times(index.values)


def _step(step):
    try:
        step = float(step)
    except (TypeError, ValueError):
        raise InputError(f"a step of {step!r}; expected seconds") from None
    if not (step > 0.0 and np.isfinite(step)):
        raise InputError(f"a step of {step}; expected seconds above 0")
    return step


def _array(name, given):
    try:
        return np.asarray(given)
    except Exception as error:  # what an __array__ of others throws
        raise InputError(f"{name} cannot be read as an array: {error}") from None


def _float64(name, given):
    """float64 in C order; the same memory where it is that already."""
    if isinstance(given, np.ma.MaskedArray):
        return given.astype(float).filled(np.nan)
    array = _array(name, given)
    kind = array.dtype.kind
    if kind == "O":
        try:
            array = np.array([np.nan if x is None else float(x) for x in array.ravel()]).reshape(array.shape)
        except (TypeError, ValueError):
            raise InputError(f"{name} holds what is no number; expected numbers, and NaN or None where one is missing") \
                from None
    elif kind not in "fiub":
        raise InputError(f"{name} is of dtype {array.dtype}; expected numbers")
    return np.ascontiguousarray(array, dtype=np.float64) if array.ndim else array


def _rows(name, given):
    array = _float64(name, given)
    if array.ndim not in (1, 2):
        raise InputError(f"{name} has {array.ndim} dimensions; expected rows, or rows x channels")
    if array.size == 0:
        raise InputError(f"{name} is {' x '.join(map(str, array.shape))}; expected one row at least")
    return array


def times(given):
    """Seconds; of datetime64 and timedelta64 from the first on."""
    array = _array("time", given)
    if array.dtype.kind == "M":
        missing = np.isnat(array)
        array = (array - array[0]) / np.timedelta64(1, "ns") * 1e-9 if array.size else array.astype(float)
        array = np.where(missing, np.nan, array)
    elif array.dtype.kind == "m":
        array = array / np.timedelta64(1, "ns") * 1e-9
    array = _float64("time", array)
    if array.ndim != 1:
        raise InputError(f"time has {array.ndim} dimensions; expected one")
    if not np.all(np.isfinite(array)):
        raise InputError("time has missing or infinite stamps; expected seconds, rising")
    return array


def recordings(data, u, time, step, columns, units):
    """What a job was given as data: recordings to hand over, and paths of files."""
    if type(data) is np.ndarray and u is time is step is columns is units is None and data.dtype == np.float64 and \
            data.flags.c_contiguous and data.ndim in (1, 2) and data.size:
        return [(None, data, None, 0.0, [], [])], []  # the same, for those who fit thousands of them
    several = isinstance(data, (list, tuple)) and len(data) > 0 and all(_is_recording(each) for each in data)
    if not several:
        return _split([_recording(data, u, time, step, columns, units)] if data is not None or u is not None else [])
    if u is not None or time is not None:
        raise InputError("several recordings, and one u or time; expected Recording(y, u=..., time=...) for each")
    return _split([_recording(each, None, None, step, columns, units) for each in data])


def _split(all_of_them):
    files = [each for each in all_of_them if isinstance(each, str)]
    return [each.handed_over() for each in all_of_them if not isinstance(each, str)], files


def _is_recording(given):
    return isinstance(given, (Recording, str, os.PathLike)) or is_frame(given) or \
        isinstance(given, np.ndarray) and given.ndim > 0


def is_frame(given):
    return hasattr(given, "index") and hasattr(given, "to_numpy") and hasattr(given, "ndim")


def _recording(data, u, time, step, columns, units):
    if isinstance(data, (str, os.PathLike)):
        if any(each is not None for each in (u, time, step, columns, units)):
            raise InputError("u, time, step, columns or units beside a file; expected them in the file and the model")
        return os.fspath(data)
    if isinstance(data, Recording):
        if any(each is not None for each in (u, time, step, columns, units)):
            raise InputError("u, time, step, columns or units beside a Recording; expected them in it")
        return data
    if is_frame(data) and u is None and time is None and (data.ndim == 2 or columns is None and data.name is not None):
        if columns is not None:
            data = data[list(columns)]
        return Recording.of_frame(data, units, step)
    if is_frame(data) and time is None:
        time = _index_times(data.index)
    return Recording(data, u=u, time=time, step=step, columns=columns, units=units)


def with_columns(data, of_recording, outputs, inputs, more):
    """The one recording, with further columns by name. outputs, inputs: what its own are called where they have no names."""
    one = _recording(data, *of_recording)
    if isinstance(one, str):
        raise InputError("truth beside a file; expected a model with `reference`, or samples in memory")
    names = one.columns or [*outputs, *inputs]
    columns = [each[:, None] if each.ndim == 1 else each for each in (one.y, one.u) if each is not None]
    for name, values in more.items():
        values = _rows(name, values)
        if values.ndim != 1 or len(values) != len(columns[0]):
            raise InputError(f"the {name} has {len(values)} rows for {len(columns[0])} samples; expected as many")
        columns.append(values[:, None])
    out = Recording(np.hstack(columns), time=one.time, step=one.step or None, columns=[*names, *more])
    out.units = [*one.units, *[None] * len(more)] if one.units else []
    return out
