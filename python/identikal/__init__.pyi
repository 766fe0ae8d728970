import os
from typing import Any, Callable, Dict, Iterable, Iterator, List, Mapping, NamedTuple, Optional, Sequence, Tuple, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

Number = Union[float, int, "np.number[Any]"]
Entry = Union[Number, str, "Expression"]
Matrix = Union[Entry, Sequence[Sequence[Entry]], NDArray[Any]]
Noise = Union[Matrix, Mapping[str, Any]]
Channels = Union[str, Sequence[str], Mapping[str, Any], None]
Progress = Union[None, bool, Callable[[str, float, float], Any]]
Path = Union[str, "os.PathLike[str]"]
Array = NDArray[np.float64]

class InputError(ValueError):
    path: Optional[str]
    line: Optional[int]
    column: Optional[int]

class IdentikalError(RuntimeError): ...
class FindingWarning(UserWarning): ...
class StoppedWarning(UserWarning): ...

class Expression:
    text: str
    parameters: Dict[str, Any]
    def __init__(self, text: str, parameters: Mapping[str, Any] = ...) -> None: ...
    def __add__(self, other: Any) -> Expression: ...
    __radd__ = __sub__ = __rsub__ = __mul__ = __rmul__ = __truediv__ = __rtruediv__ = __pow__ = __rpow__ = __add__
    __lt__ = __le__ = __gt__ = __ge__ = __and__ = __or__ = __add__
    def __neg__(self) -> Expression: ...
    def __invert__(self) -> Expression: ...
    def __abs__(self) -> Expression: ...

def p(name: str, value: Union[Number, str] = ..., *, min: Any = ..., max: Any = ..., unit: Optional[str] = ..., prior: Any = ...,
      fixed: Optional[bool] = ..., role: Optional[str] = ...) -> Expression: ...
def free(value: Union[Number, str], *, min: Any = ..., max: Any = ..., unit: Optional[str] = ..., prior: Any = ...) -> Dict[str, Any]: ...

class Model:
    path: Optional[str]
    def __init__(self, path: Path) -> None: ...
    @classmethod
    def from_text(cls, text: str) -> Model: ...
    @classmethod
    def from_yaml(cls, text_or_path: Path) -> Model: ...
    @classmethod
    def template(cls, name: str) -> Model: ...
    @property
    def text(self) -> str: ...

class LinearModel(Model):
    def __init__(self, A: Matrix, C: Matrix, *, B: Optional[Matrix] = ..., D: Optional[Matrix] = ..., G: Optional[Matrix] = ...,
                 Q: Noise = ..., R: Noise = ..., S: Optional[Matrix] = ..., initial: Any = ..., step: Union[Number, str, None] = ...,
                 continuous: bool = ..., irregular: bool = ..., process_noise: Optional[str] = ..., inputs: Channels = ...,
                 outputs: Channels = ..., states: Any = ..., parameters: Optional[Mapping[str, Any]] = ...,
                 inputs_held: Optional[str] = ..., name: str = ..., **more: Any) -> None: ...

class FormulaModel(Model):
    def __init__(self, dynamics: Union[Mapping[str, Entry], Callable[..., Any]], outputs: Union[Mapping[str, Any], Callable[..., Any]],
                 *, states: Any = ..., inputs: Channels = ..., parameters: Optional[Mapping[str, Any]] = ...,
                 process_variance: Any = ..., process_sd: Any = ..., measurement_variance: Any = ..., measurement_sd: Any = ...,
                 initial: Any = ..., step: Union[Number, str, None] = ..., discrete: bool = ..., irregular: bool = ...,
                 inputs_held: Optional[str] = ..., output_names: Optional[Sequence[str]] = ...,
                 let: Optional[Mapping[str, Entry]] = ..., name: str = ..., **more: Any) -> None: ...

class Car(Model):
    def __init__(self, mass: Any, a: Any, b: Any, *, steering_ratio: Any = ..., Iz: Any = ..., Cf: Any = ..., Cr: Any = ...,
                 outputs: Channels = ..., inputs: Channels = ..., steering: str = ..., sd: Optional[Mapping[str, Number]] = ...,
                 step: Union[Number, str, None] = ..., parameters: Optional[Mapping[str, Any]] = ..., name: str = ...,
                 **more: Any) -> None: ...

class Recording:
    y: Optional[Array]
    u: Optional[Array]
    time: Optional[Array]
    step: float
    columns: List[str]
    units: List[Optional[str]]
    def __init__(self, y: Optional[ArrayLike] = ..., *, u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ...,
                 step: Optional[float] = ..., columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ...) -> None: ...

class Parameter(NamedTuple):
    name: str
    value: float
    se: float
    interval: Tuple[float, float]
    bound_se: float
    unit: str
    verdict: str
    start: float
    fixed: bool
    limits: Tuple[float, float]

class Finding(NamedTuple):
    severity: str
    code: str
    text: str
    remedy: str

class Parameters(Dict[str, Parameter]):
    def values_by_name(self) -> Dict[str, float]: ...

class Result:
    verb: str
    code: int
    status: Optional[str]
    ok: bool
    message: str
    findings: List[Finding]
    params: Parameters
    log_likelihood: float
    aic: float
    bic: float
    document: Dict[str, Any]
    tests: List[Dict[str, Any]]
    references: List[Dict[str, Any]]
    correlation: Optional[Array]
    correlation_names: List[str]
    A: Optional[Array]
    B: Optional[Array]
    C: Optional[Array]
    D: Optional[Array]
    G: Optional[Array]
    Q: Optional[Array]
    R: Optional[Array]
    S: Optional[Array]
    K: Optional[Array]
    L: Optional[Array]
    P: Optional[Array]
    Sigma: Optional[Array]
    time: Optional[Array]
    measured: Optional[Array]
    predicted: Optional[Array]
    innovations: Optional[Array]
    standardised: Optional[Array]
    states: Optional[Array]
    state_sd: Optional[Array]
    tracked: Optional[Array]
    tracked_sd: Optional[Array]
    values: Optional[Array]
    columns: List[str]
    series_names: List[str]
    model: Optional[Model]
    tuned_model: Model
    def series(self, name: str) -> Optional[Array]: ...
    def online_filter(self) -> OnlineFilter: ...
    def export(self, to: str) -> str: ...
    def summary(self) -> str: ...
    def report(self) -> str: ...
    def to_dict(self) -> Dict[str, Any]: ...
    def to_frame(self) -> Any: ...
    def plot(self) -> Any: ...

class OnlineFilter:
    states: int
    inputs: int
    outputs: int
    def __init__(self, of: Union[Model, Result]) -> None: ...
    def step(self, y: ArrayLike, u: Optional[ArrayLike] = ...) -> Tuple[Array, Array, Array]: ...

AnyModel = Union[Model, Result, Path]

def tune(model: AnyModel, data: Any = ..., *, u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ..., step: Optional[float] = ...,
         columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ..., progress: Progress = ..., warn: bool = ...,
         **options: Any) -> Result: ...

fit = check = shape = track = bound = simulate = forecast = filter = smooth = tune

def handling(model: AnyModel, data: Any = ..., *, u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ...,
             step: Optional[float] = ..., columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ...,
             warn: bool = ..., **options: Any) -> Result: ...
def model(data: Any, *, u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ..., step: Optional[float] = ...,
          columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ..., progress: Progress = ...,
          warn: bool = ..., **options: Any) -> Result: ...
def validate(result: Result, data: Any, *, u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ..., step: Optional[float] = ...,
             columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ..., progress: Progress = ...,
             warn: bool = ..., **options: Any) -> Result: ...
def compare(*given: AnyModel, data: Any = ..., u: Optional[ArrayLike] = ..., time: Optional[ArrayLike] = ...,
            step: Optional[float] = ..., columns: Optional[Iterable[str]] = ..., units: Optional[Mapping[str, str]] = ...,
            warn: bool = ..., **options: Any) -> Result: ...
def extended_filter(dynamics: Callable[..., Any], outputs: Callable[..., Any], *, Q: Any, R: Any, mean: Any, covariance: Any) -> Callable[..., Any]: ...
def tune_external(filter: Callable[..., Any], start: Any, data: Any = ..., *, limits: Any = ..., iterations: Optional[int] = ...,
                  progress: Progress = ..., warn: bool = ...) -> Result: ...

class PopulationParameter(NamedTuple):
    name: str
    unit: str
    logarithm: bool
    typical: float
    interval: Tuple[float, float]
    spread: float
    spread_interval: Tuple[float, float]
    p_same: float
    units: Dict[str, float]
    strangers: List[str]
    trends: List[Dict[str, Any]]

class Fleet:
    path: str
    columns: List[str]
    statuses: Dict[str, int]
    complete: bool
    failed: Dict[str, str]
    def __init__(self, store: Path) -> None: ...
    def __getitem__(self, column: str) -> Any: ...
    def __len__(self) -> int: ...
    def population(self) -> Dict[str, PopulationParameter]: ...
    def summary(self) -> str: ...
    def export(self, path: Optional[Path] = ...) -> Optional[str]: ...
    def to_frame(self) -> Any: ...
    def report(self) -> str: ...
    def resume(self, *, progress: Progress = ..., **options: Any) -> Fleet: ...

def each(verb: str, model: Any, recordings: Iterable[Any], *, step: Optional[float] = ..., columns: Optional[Sequence[str]] = ...,
         units: Optional[Mapping[str, str]] = ..., threads: Optional[int] = ..., progress: Progress = ..., **options: Any) -> Iterator[Result]: ...
def fleet(verb: str, model: AnyModel, recordings: Any, store: Optional[Path] = ..., *, progress: Progress = ..., **options: Any) -> Fleet: ...
