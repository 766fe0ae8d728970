"""Models: from matrices, formulas, functions, a car, or a model file. All of them are the text of a model file
(`model.text`, examples/MODEL_FILE.md), with the same checks and the same defaults."""

import inspect
import json
import os

import numpy as np

from . import _identikal, expressions
from ._errors import InputError
from .expressions import Expression, Symbols, text_of


class Model:
    """A model file: its text, or its path. Two models are equal where their texts are.

        Model("examples/nile.yaml")
        Model.from_text(text)
    """

    def __init__(self, path):
        try:
            self.path = os.fspath(path)
        except TypeError:
            raise InputError(f"a {type(path).__name__} as a model; expected the path of a model file, or one of "
                             "LinearModel, FormulaModel, Car, Model.from_text") from None
        if "\n" in self.path:
            raise InputError("a text of several lines as a path; expected Model.from_text(text)")
        self._text = None

    @classmethod
    def from_text(cls, text):
        """The model file whose text this is."""
        if not isinstance(text, str):
            raise InputError(f"a {type(text).__name__} as the text of a model file; expected a str")
        out = cls.__new__(cls)
        out.path, out._text = None, text
        return out

    @classmethod
    def from_yaml(cls, text_or_path):
        """A text where it has several lines, else a path."""
        if isinstance(text_or_path, str) and "\n" in text_or_path:
            return Model.from_text(text_or_path)
        return Model(text_or_path)

    @classmethod
    def template(cls, name):
        """One of the commented model files of `identikal init`, which lists them: "constant-velocity", "battery", ..."""
        texts = dict(_identikal.templates())
        if name not in texts:
            raise InputError(f"'{name}' is no template; expected one of {', '.join(texts)}")
        return cls.from_text(texts[name])

    def _given(self):
        """Text and path, one of them empty."""
        return (self._text or "", self.path or "")

    @property
    def text(self):
        """The model file."""
        if self._text is not None:
            return self._text
        try:
            with open(self.path, encoding="utf-8") as file:
                return file.read()
        except OSError as error:
            raise InputError(f"{self.path}: {error.strerror}") from None

    def __eq__(self, other):
        if not isinstance(other, Model):
            return NotImplemented
        return (self.path, self._text) == (other.path, other._text)

    def __hash__(self):
        return hash((self.path, self._text))

    def __repr__(self):
        return f"Model({self.path!r})" if self.path else f"<{type(self).__name__}>\n{self._text}"

    def __reduce__(self):
        return (Model, (self.path,)) if self.path else (Model.from_text, (self._text,))


class _Written(Model):
    """A model whose text is made of keys and values."""

    def __init__(self, keys):
        self.path = None
        lines = ["identikal: 1"]
        for key, value in keys.items():
            if value is not None:
                lines.append(f"{key}: {_flow(value)}")
        self._text = "\n".join(lines) + "\n"


def _flow(value):
    """Keys and values in one line, as YAML and JSON write them."""
    return json.dumps(_plain(value), ensure_ascii=False)


def _plain(value):
    if isinstance(value, Expression):
        return value.text
    if isinstance(value, dict):
        return {str(key): _plain(each) for key, each in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(each) for each in value]
    if isinstance(value, (str, bool)) or value is None:
        return value
    if isinstance(value, (int, np.integer)):
        return int(value)
    return float(expressions.number(value)) if isinstance(value, (float, np.floating)) else _refuse(value)


def _refuse(value):
    raise InputError(f"a {type(value).__name__} in a model; expected numbers, texts, lists and dicts")


class _Parameters:
    """Parameters that were described where they stand, and those of the argument `parameters`."""

    def __init__(self, given):
        self.all = {}
        for name, value in _mapping("parameters", given).items():
            if isinstance(value, Expression):
                value = value.parameters.get(value.text, value)
            self.all[str(name)] = _plain(value)

    def entry(self, value):
        """A number, or a formula, whose parameters are kept."""
        if isinstance(value, Expression):
            for name, description in value.parameters.items():
                if self.all.setdefault(name, description) != description:
                    raise InputError(f"the parameter '{name}' is described twice, {self.all[name]} and {description}; "
                                     "expected one description")
            return value.text
        if isinstance(value, str):
            return value
        return float(expressions.number(_real(value)))

    def matrix(self, name, given):
        """Rows of entries; a number alone is 1 x 1."""
        if given is None:
            return None
        if not _is_sequence(given):
            return [[self.entry(given)]]
        rows = [list(row) if _is_sequence(row) else None for row in given]
        if not rows or None in rows:
            raise InputError(f"{name} is no list of rows; expected {name}=[[...], [...]] or an array of two dimensions")
        if len({len(row) for row in rows}) != 1:
            raise InputError(f"the rows of {name} have {', '.join(str(len(row)) for row in rows)} entries; expected as "
                             "many in each")
        return [[self.entry(each) for each in row] for row in rows]

    def noise(self, name, given):
        if isinstance(given, str):
            if given not in ("diagonal", "full", "scaled-identity"):
                raise InputError(f"{name} is '{given}'; expected 'diagonal', 'full', 'scaled-identity', a matrix, or a "
                                 "dict of structure and start")
            return {"structure": given, "start": 1.0}
        if isinstance(given, dict):
            return _plain(given)
        return self.matrix(name, given)

    def entries(self, name, given):
        return {str(key): self.entry(value) for key, value in _mapping(name, given).items()}


def _mapping(name, given):
    if given is None:
        return {}
    if not isinstance(given, dict):
        raise InputError(f"{name} is a {type(given).__name__}; expected a dict of names")
    return given


def _is_sequence(given):
    return isinstance(given, (list, tuple)) or isinstance(given, np.ndarray) and given.ndim > 0


def _real(value):
    if isinstance(value, np.ndarray) and value.ndim == 0:
        value = value.item()
    if isinstance(value, (bool, int, float, np.number, np.bool_)) and not isinstance(value, (complex, np.complexfloating)):
        return value
    raise InputError(f"a {type(value).__name__} in a matrix; expected a number, a formula's text, or p(...)")


def _time(step, continuous, irregular, inputs_held):
    for name, given in (("continuous", continuous), ("irregular", irregular)):
        if not isinstance(given, bool):
            raise InputError(f"{name} is {given!r}; expected True or False")
    out = {}
    if continuous:
        out["kind"] = "continuous"
    if step is None or irregular:
        out["column"] = "t"
    if step is not None:
        out["step"] = step if isinstance(step, str) else float(expressions.number(_real(step)))
    if irregular:
        out["sampling"] = "irregular"
    if inputs_held is not None:
        out["inputs"] = inputs_held
    return out


def _channels(given, letter, count):
    """Channels by their names, or as many as are needed: y, or y1, y2, ..."""
    if given is None:
        return [{"name": letter if count == 1 else f"{letter}{i + 1}"} for i in range(count)]
    if isinstance(given, dict):
        return {str(name): {} if value is None else {"column": value} if isinstance(value, (str, int)) else value
                for name, value in given.items()}
    names = [given] if isinstance(given, str) else given
    if not isinstance(names, (list, tuple)) or not all(isinstance(name, str) for name in names):
        raise InputError(f"channels are {given!r}; expected a list of names, or a dict of names and columns")
    return [{"name": name} for name in names]


def _initial(given, parameters, states=None):
    if given is None or isinstance(given, (str, dict)) and not (states and _by_state(given, states)):
        return given
    if isinstance(given, dict):
        mean = {name: value[0] if isinstance(value, (tuple, list)) else value for name, value in given.items()}
        sd = {name: value[1] for name, value in given.items() if isinstance(value, (tuple, list))}
        if any(isinstance(value, str) and value in ("diffuse", "stationary") for value in given.values()):
            return {name: {"mean": parameters.entry(value[0]), "sd": parameters.entry(value[1])}
                    if isinstance(value, (tuple, list)) else value if isinstance(value, str) else parameters.entry(value)
                    for name, value in given.items()}
        out = {"mean": parameters.entries("initial", mean)}
        if sd:
            out["sd"] = parameters.entries("initial", sd)
        return out
    if isinstance(given, (tuple, list)) and len(given) == 2:
        try:
            mean, covariance = (np.atleast_1d(np.asarray(each, float)) for each in given)
        except (TypeError, ValueError):
            raise InputError("an initial mean or covariance that is no array of numbers; expected (mean, covariance)") \
                from None
        key = "covariance" if covariance.ndim == 2 else "sd"
        return {"mean": mean.tolist(), key: covariance.tolist()}
    raise InputError("an initial state that is not understood; expected 'diffuse', 'stationary', (mean, covariance), or a "
                     "dict of states")


def _by_state(given, states):
    return isinstance(given, dict) and set(given) <= set(states)


class LinearModel(_Written):
    """x(t+1) = A x + B u + G w, y = C x + D u + v, w ~ (0, Q), v ~ (0, R), cov(w, v) = S; with continuous=True
    dx/dt = A x + B u + G w.

    A n x n, C ny x n, B n x nu, D ny x nu, G n x nw (without it the identity), S nw x ny: rows of numbers, of
        formulas ("1 - h/tau") and of p(...); a number alone is 1 x 1
    Q, R     the same, or what is estimated as a whole: "diagonal", "full", "scaled-identity", or
             {"structure": "full", "start": [...]}
    initial  "stationary" (A is stable), "diffuse" (nothing is known), (mean, covariance or sd), or as a model file
             says it, {"x1": "diffuse", "x2": "stationary"}
    step     the sampling period [s]; without it recordings have times or a step of their own
    process_noise  "per-sample" or "density", in continuous time
    inputs, outputs  names, or {name: column}; parameters  {name: p(...) or number} that formulas name
    more     further keys of a model file

        LinearModel(A=[[1, 0.1], [0, 1]], C=[[1, 0]], G=[[0.005], [0.1]], Q=[[p("q", min=0)]], R=[[p("r", min=0)]],
                    initial="diffuse", step=0.1)
    """

    def __init__(self, A, C, *, B=None, D=None, G=None, Q="diagonal", R="diagonal", S=None, initial="stationary",
                 step=None, continuous=False, irregular=False, process_noise=None, inputs=None, outputs=None,
                 states=None, parameters=None, inputs_held=None, name="model", **more):
        described = _Parameters(parameters)
        matrices = {key: described.matrix(key, value) for key, value in
                    {"A": A, "B": B, "G": G, "C": C, "D": D, "S": S}.items()}
        if matrices["A"] is None or matrices["C"] is None:
            raise InputError("a linear model without A or C; expected both")
        noise = {"Q": described.noise("Q", Q), "R": described.noise("R", R)}
        time = _time(step, continuous, irregular, inputs_held)
        if continuous and process_noise is None:
            process_noise = "density"
        inputs_of = matrices["B"] or matrices["D"]
        keys = {
            "name": name, "time": time, "parameters": None, **matrices, **noise,
            "states": states, "noise": {"process": process_noise} if process_noise else None,
            "initial": _initial(initial, described),
            "inputs": _channels(inputs, "u", len(inputs_of[0]) if inputs_of else 0) if inputs_of or inputs is not None
            else None, "outputs": _channels(outputs, "y", len(matrices["C"])), **more}
        keys["parameters"] = described.all or None
        super().__init__(keys)


class FormulaModel(_Written):
    """dx/dt = f(x, u, p, t), or with discrete=True x(t+1) = f, y = h(x, u, p, t).

    dynamics  {state: formula}, or a function f(x, u, p, t), or of some of these, that returns a formula for each
              state; it is called once, with names in place of numbers: operators and numpy's functions, np.where
              in place of if
    outputs   {output: formula}, or a function of the same arguments together with output_names
    states    names, or {name: unit}; not needed where dynamics is a dict
    inputs    names, or {name: column}
    parameters  {name: number, known; or free(...), estimated}
    process_variance, process_sd          {state: number or formula}; others are not disturbed; a density, with
                                          discrete=True per sample
    measurement_variance, measurement_sd  {output: number or formula}, or one for all
    initial   {state: mean, known; (mean, sd); "diffuse" where it moves linearly}, or as a model file says it
    let       {name: formula}; more  further keys of a model file

        FormulaModel({"phi": "w", "w": "-g/l*sin(phi)"}, {"angle": "phi"}, parameters={"l": free(0.8, min=0.1)},
                     process_sd={"w": 0.1}, measurement_sd=0.01, initial={"phi": (0.3, 0.1), "w": 0})
    """

    def __init__(self, dynamics, outputs, *, states=None, inputs=None, parameters=None, process_variance=None,
                 process_sd=None, measurement_variance=None, measurement_sd=None, initial=None, step=None,
                 discrete=False, irregular=False, inputs_held=None, output_names=None, let=None, name="model", **more):
        described = _Parameters(parameters)
        if states is None and isinstance(dynamics, dict):
            states = list(dynamics)
        if states is None:
            raise InputError("dynamics as a function, and no states; expected states=['x1', ...]")
        names = [str(state) for state in states]
        channels = _channels(inputs, "u", 0)
        input_names = list(channels) if isinstance(channels, dict) else [each["name"] for each in channels]
        arguments = {"x": Symbols(names), "u": Symbols(input_names), "p": Symbols(list(described.all)),
                     "t": Expression("t")}
        motion = _formulas(dynamics, arguments, names, described)
        if output_names is None and isinstance(outputs, dict):
            output_names = list(outputs)
        if output_names is None:
            raise InputError("outputs as a function, and no names; expected output_names=['y', ...]")
        seen = _formulas(outputs, arguments, [str(each) for each in output_names], described)
        equations = {output: {**value, "equals": value["equals"]} if isinstance(value, dict) else {"equals": value}
                     for output, value in seen.items()}
        noise = {}
        kind = "per-sample" if discrete else "density"
        for key, variance, sd in (("process", process_variance, process_sd),
                                  ("measurement", measurement_variance, measurement_sd)):
            if variance is None and sd is None:
                continue
            given = variance if variance is not None else sd
            if not isinstance(given, dict):
                given = {each: given for each in (names if key == "process" else equations)}
            noise[key] = {"variance" if variance is not None else "sd": described.entries(f"the noise of {key}", given)}
            if key == "process":
                noise[key]["kind"] = kind
        time = {"kind": "discrete" if discrete else "continuous", **_time(step, False, irregular, inputs_held)}
        keys = {"name": name, "time": time, "parameters": None, "states": states if isinstance(states, dict) else names,
                "let": described.entries("let", let) if let else None, "dynamics": motion,
                "inputs": channels or None, "outputs": equations, "noise": noise or None,
                "initial": _initial(initial, described, names), **more}
        keys["parameters"] = described.all or None
        super().__init__(keys)


def _formulas(given, arguments, names, described):
    """A formula for each name: those of a dict, or what a function makes of the arguments."""
    if callable(given):
        given = given(*[arguments[name] for name in _wanted(given)])
        if not _is_sequence(given) and not isinstance(given, dict):
            given = [given]
        if not isinstance(given, dict):
            values = list(given)
            if len(values) != len(names):
                raise InputError(f"a function returns {len(values)} formulas for {', '.join(names)}; expected {len(names)}")
            given = dict(zip(names, values))
    if not isinstance(given, dict):
        raise InputError(f"a {type(given).__name__} in place of formulas; expected a dict or a function")
    return {str(name): {**value, "equals": described.entry(value["equals"])} if isinstance(value, dict)
            else described.entry(value) for name, value in given.items()}


def _wanted(function):
    """Which of x, u, p, t it takes: by name, else by place."""
    names = [each.name for each in inspect.signature(function).parameters.values()
             if each.kind in (each.POSITIONAL_ONLY, each.POSITIONAL_OR_KEYWORD)]
    if set(names) <= {"x", "u", "p", "t"}:
        return names
    if len(names) > 4:
        raise InputError(f"a function of {len(names)} arguments; expected some of x, u, p, t")
    return ["x", "u", "p", "t"][:len(names)]


def free(value, *, min=None, max=None, unit=None, prior=None):
    """A parameter that is estimated from this start, for `parameters` and Car; numbers in `unit`, else in SI."""
    return expressions.definition(value, min=min, max=max, unit=unit, prior=prior)


class Car(_Written):
    """The single-track vehicle, axes and signs of ISO 8855 (examples/MODEL_FILE.md).

    mass [kg], a, b [m] (centre of gravity to front and rear axle), steering_ratio: known numbers
    Iz [kg m^2], Cf, Cr [N/rad] per axle: numbers are known, free(...) is estimated; without them they are estimated
    outputs   some of r [rad/s], vy [m/s], ay [m/s^2], beta [rad]: names, or {name: column}, or
              {"r": {"column": "yaw_rate", "unit": "deg/s"}}
    steering  "steering_wheel_angle" [rad] or "road_wheel_angle" [rad]; inputs  columns of it and of vx [m/s], as outputs
    sd        {output: standard deviation of its noise, SI}; without it the residuals tell
    parameters  further ones: {"steering_delay": free(0.05, max=0.3)}; more  further keys of a model file

        Car(mass=1446, a=0.987, b=1.525, steering_ratio=21, outputs=["r", "vy"])
    """

    def __init__(self, mass, a, b, *, steering_ratio=None, Iz=None, Cf=None, Cr=None, outputs=("r",), inputs=None,
                 steering="steering_wheel_angle", sd=None, step=None, parameters=None, name="car", **more):
        if steering not in ("steering_wheel_angle", "road_wheel_angle"):
            raise InputError(f"steering is '{steering}'; expected 'steering_wheel_angle' or 'road_wheel_angle'")
        if steering == "steering_wheel_angle" and steering_ratio is None:
            raise InputError("a steering wheel's angle without steering_ratio; expected a number, or "
                             "steering='road_wheel_angle'")
        m = float(_real(mass)) if not isinstance(mass, (str, dict)) else 1500.0
        given = {"m": mass, "a": a, "b": b, "steering_ratio": steering_ratio,
                 "Iz": free(m * 1.6) if Iz is None else Iz,
                 "Cf": free(m * 60.0) if Cf is None else Cf, "Cr": free(m * 60.0) if Cr is None else Cr,
                 **(parameters or {})}
        described = _Parameters({key: value for key, value in given.items() if value is not None})
        keys = {"name": name, "model": "single-track", "time": _time(step, False, False, None),
                "parameters": described.all, "inputs": _channels(inputs or [steering, "vx"], "u", 2),
                "outputs": _channels(outputs, "y", 1),
                "noise": {"measurement": {"kind": "per-sample", "sd": described.entries("sd", sd)}} if sd else None, **more}
        super().__init__(keys)
