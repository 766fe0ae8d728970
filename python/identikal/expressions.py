"""Formulas: names, numbers and what Python does with them, as the text of a model file.

    tau = p("tau", 2.0, min=0.1)
    LinearModel(A=[[1 - 0.1 / tau]], ...)
"""

import math
import numbers

import numpy as np

from ._errors import InputError

# numpy's name -> the formula's.
_FUNCTIONS = {
    "sin": "sin", "cos": "cos", "tan": "tan", "arcsin": "asin", "arccos": "acos", "arctan": "atan", "arctan2": "atan2",
    "sinh": "sinh", "cosh": "cosh", "tanh": "tanh", "exp": "exp", "log": "log", "log10": "log10", "sqrt": "sqrt",
    "absolute": "abs", "fabs": "abs", "sign": "sign", "floor": "floor", "minimum": "min", "maximum": "max",
    "fmin": "min", "fmax": "max", "hypot": "hypot",
}
_OPERATORS = {
    "add": "+", "subtract": "-", "multiply": "*", "divide": "/", "true_divide": "/", "power": "^", "float_power": "^",
    "less": "<", "less_equal": "<=", "greater": ">", "greater_equal": ">=", "equal": "==", "not_equal": "!=",
    "logical_and": "and", "logical_or": "or",
}


def number(value):
    """A number as a model file reads it back, to the last digit."""
    value = float(value)
    if not math.isfinite(value):
        raise InputError(f"{value} in a model; expected a finite number")
    return repr(value)


def text_of(value):
    """A number, a formula's text or an Expression as a formula's text."""
    if isinstance(value, Expression):
        return value.text
    if isinstance(value, str):
        return value
    if isinstance(value, (numbers.Real, np.number)) and not isinstance(value, complex):
        text = number(value)
        return f"({text})" if text.startswith("-") else text
    if isinstance(value, np.ndarray) and value.ndim == 0:
        return text_of(value.item())
    raise InputError(f"a {type(value).__name__} in a formula; expected a number, a text or an expression of p(...)")


class Expression:
    """A formula that grows by arithmetic: + - * / ** abs() comparisons & | ~ and numpy's functions."""

    __slots__ = ("text", "parameters")
    __array_priority__ = 1000

    def __init__(self, text, parameters=()):
        self.text = text
        self.parameters = dict(parameters)

    def __repr__(self):
        return self.text

    def __bool__(self):
        raise InputError(f"'if' asks whether {self.text} holds, which is not known before a recording; "
                         "expected np.where(condition, then, otherwise)")

    def __hash__(self):
        return hash(self.text)

    def __float__(self):
        raise InputError(f"{self.text} is no number yet; expected numpy's functions in place of math's")

    __index__ = __int__ = __float__

    def __array_ufunc__(self, ufunc, method, *inputs, **keywords):
        name = ufunc.__name__
        if method != "__call__" or keywords:
            raise InputError(f"numpy's {name}.{method} of a formula; expected a plain call")
        if any(isinstance(each, np.ndarray) and each.ndim for each in inputs):
            # numpy goes over arrays by their elements.
            return np.frompyfunc(lambda *parts: _call(name, parts), len(inputs), 1)(
                *[_boxed(each) if isinstance(each, Expression) else each for each in inputs])
        return _call(name, inputs)

    def __array_function__(self, function, types, arguments, keywords):
        if function is np.where and len(arguments) == 3 and not keywords:
            return _joined("if({}, {}, {})", arguments)
        if function is np.clip and len(arguments) == 3 and not keywords:
            value, low, high = arguments
            return np.minimum(np.maximum(value, low), high)
        raise InputError(f"numpy's {function.__name__} of a formula; expected one of "
                         f"{', '.join(sorted(_FUNCTIONS))}, where, clip")

    def __abs__(self):
        return _call("absolute", (self,))

    def __neg__(self):
        return _joined("(-{})", (self,))

    def __pos__(self):
        return self

    def __invert__(self):
        return _joined("(not {})", (self,))


def _boxed(expression):
    box = np.empty((), dtype=object)
    box[()] = expression
    return box


def _joined(form, parts):
    parameters = {}
    for part in parts:
        if isinstance(part, Expression):
            for name, definition in part.parameters.items():
                _take(parameters, name, definition)
    return Expression(form.format(*[text_of(part) for part in parts]), parameters)


def _take(parameters, name, definition):
    if parameters.setdefault(name, definition) != definition:
        raise InputError(f"the parameter '{name}' is described twice, {parameters[name]} and {definition}; expected one "
                         "p(...) that is used wherever it stands")


def _call(name, parts):
    if name in _OPERATORS:
        return _joined("({} " + _OPERATORS[name] + " {})", parts)
    if name in _FUNCTIONS:
        return _joined(_FUNCTIONS[name] + "(" + ", ".join(["{}"] * len(parts)) + ")", parts)
    if name == "negative":
        return -parts[0]
    if name == "positive":
        return parts[0]
    if name == "square":
        return parts[0] * parts[0]
    if name == "reciprocal":
        return 1.0 / parts[0]
    if name == "logical_not":
        return ~parts[0]
    raise InputError(f"numpy's {name} of a formula; expected one of {', '.join(sorted(_FUNCTIONS))}, where, clip")


def _operator(name, swapped=False):
    def apply(self, other):
        if isinstance(other, np.ndarray) and other.ndim:
            return NotImplemented
        return _call(name, (other, self) if swapped else (self, other))
    return apply


for _name, _ufunc in {"add": "add", "sub": "subtract", "mul": "multiply", "truediv": "divide", "pow": "power"}.items():
    setattr(Expression, f"__{_name}__", _operator(_ufunc))
    setattr(Expression, f"__r{_name}__", _operator(_ufunc, swapped=True))
for _name, _ufunc in {"lt": "less", "le": "less_equal", "gt": "greater", "ge": "greater_equal", "eq": "equal",
                      "ne": "not_equal", "and": "logical_and", "or": "logical_or"}.items():
    setattr(Expression, f"__{_name}__", _operator(_ufunc))


# numpy calls these on the elements of arrays.
for _name in _FUNCTIONS:
    if _name not in ("absolute", "fabs", "minimum", "maximum", "fmin", "fmax"):
        setattr(Expression, _name, lambda *parts, _of=_name: _call(_of, parts))


class Symbols(np.ndarray):
    """Names as an array of formulas: x[0], x["phi"] and x.phi are the same."""

    def __new__(cls, names):
        out = np.empty(len(names), dtype=object).view(cls)
        for i, name in enumerate(names):
            np.ndarray.__setitem__(out, i, Expression(name))
        out._names = tuple(names)
        return out

    def __array_finalize__(self, of):
        self._names = ()

    def __getitem__(self, key):
        return super().__getitem__(self._place(key) if isinstance(key, str) else key)

    def __getattr__(self, name):
        if name.startswith("_"):
            raise AttributeError(name)
        return np.ndarray.__getitem__(self, self._place(name))

    def _place(self, name):
        if name not in self._names:
            raise InputError(f"'{name}' is not one of {', '.join(self._names) or 'nothing'}; expected a name of the model")
        return self._names.index(name)


def p(name, value=1.0, *, min=None, max=None, unit=None, prior=None, fixed=None, role=None):
    """A parameter by name, to stand in matrices and formulas; estimated from the start `value` unless `fixed`.

    value, min, max  in `unit`, else in SI, or texts with a unit of their own ("80 kN/rad")
    prior            as a model file says it: {"normal": {"mean": 2300, "sd": 200}}

        q = p("q", 1000, min=0)
        LinearModel(A=[[1.0]], C=[[1.0]], Q=[[q]], R=[[2 * q]], initial="diffuse")
    """
    if not isinstance(name, str) or not name:
        raise InputError(f"a parameter called {name!r}; expected a name")
    return Expression(name, {name: definition(value, min=min, max=max, unit=unit, prior=prior, fixed=fixed, role=role)})


def definition(value, **more):
    """What the model file says of a parameter: numbers and texts by key."""
    out = {"value": _quantity(value)}
    for key, given in more.items():
        if given is not None:
            out[key] = _quantity(given) if key in ("min", "max") else given
    return out


def _quantity(value):
    if isinstance(value, (str, bool)):
        return value
    if isinstance(value, (numbers.Real, np.number)):
        number(value)
        return float(value)
    raise InputError(f"a {type(value).__name__} as the value of a parameter; expected a number, or a text with a unit")
