"""libidentikal.so through ctypes: what identikal.h says, in Python."""
import ctypes
from ctypes import POINTER, byref, c_char_p, c_double, c_int, c_size_t, c_void_p

PROGRESS = ctypes.CFUNCTYPE(c_int, c_void_p, c_char_p, c_double, c_double)


class Recording(ctypes.Structure):
    _fields_ = [("time", POINTER(c_double)), ("y", POINTER(c_double)), ("u", POINTER(c_double)), ("rows", c_size_t),
                ("ny", c_size_t), ("nu", c_size_t), ("step", c_double), ("names", POINTER(c_char_p)), ("units", POINTER(c_char_p))]


class Callbacks(ctypes.Structure):
    _fields_ = [("size", c_size_t), ("progress", PROGRESS), ("user", c_void_p)]


def load(path):
    library = ctypes.CDLL(path)
    library.ik_run.argtypes = [c_char_p, c_char_p, POINTER(Recording), c_size_t, POINTER(c_void_p), c_size_t, c_char_p,
                               POINTER(Callbacks), POINTER(c_void_p)]
    for name in ("json", "message", "report_html"):
        function = getattr(library, f"ik_result_{name}")
        function.restype, function.argtypes = c_char_p, [c_void_p]
    library.ik_result_series.restype = POINTER(c_double)
    library.ik_result_series.argtypes = [c_void_p, c_char_p, POINTER(c_size_t), POINTER(c_size_t)]
    library.ik_result_free.argtypes = [c_void_p]
    library.ik_version.restype = c_char_p
    return library


def numbers(values):
    return (c_double * len(values))(*values)


def texts(values):
    return (c_char_p * len(values))(*[v.encode() if v is not None else None for v in values])


def recording(columns, outputs, inputs=(), time=None, step=0.0, names=None, units=None):
    """columns: name -> list of numbers. What it points to lives as long as it does."""
    rows = len(next(iter(columns.values())))
    out = Recording(rows=rows, ny=len(outputs), nu=len(inputs), step=step)
    out.y = numbers([columns[name][i] for i in range(rows) for name in outputs])
    if inputs:
        out.u = numbers([columns[name][i] for i in range(rows) for name in inputs])
    if time is not None:
        out.time = numbers(columns[time])
    if names:
        out.names = texts(names)
    if units:
        out.units = texts(units)
    return out


class Result:
    def __init__(self, library, handle, code):
        self.library, self.handle, self.code = library, handle, code

    @property
    def json(self):
        return self.library.ik_result_json(self.handle).decode()

    @property
    def message(self):
        return self.library.ik_result_message(self.handle).decode()

    @property
    def page(self):
        return self.library.ik_result_report_html(self.handle).decode()

    def series(self, name):
        rows, cols = c_size_t(), c_size_t()
        values = self.library.ik_result_series(self.handle, name.encode(), byref(rows), byref(cols))
        return [[values[i * cols.value + j] for j in range(cols.value)] for i in range(rows.value)]

    def __del__(self):
        self.library.ik_result_free(self.handle)


def run(library, verb, model=None, recordings=(), previous=(), options="{}", progress=None):
    result = c_void_p()
    callbacks = Callbacks(ctypes.sizeof(Callbacks), PROGRESS(progress), None) if progress else None
    code = library.ik_run(verb.encode(), model.encode() if model is not None else None,
                          (Recording * len(recordings))(*recordings), len(recordings),
                          (c_void_p * len(previous))(*[p.handle for p in previous]), len(previous), options.encode(),
                          byref(callbacks) if callbacks else None, byref(result))
    return Result(library, result, code)
