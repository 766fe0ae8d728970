"""Options, threads, interruptions, filters of others, and many calls."""
import math
import os
import resource
import subprocess
import sys
import threading
import types

import numpy as np
import pytest

import identikal as ik
import python_calls


@pytest.mark.parametrize("options", [
    {"startz": 1}, {"starts": "many"}, {"starts": -1}, {"starts": [1, 2]}, {"method": "guess"}, {"lags": 5}, {"set": {"qq": 1}},
    {"hold_out": object()}, {"progress": 3}, {"json": True}, {"starts": float("nan")}])
def test_refused_options(level, flow, options):
    with pytest.raises(ik.InputError):
        ik.tune(level, flow, **options)


def test_options(level, flow, tuned):
    assert ik.tune(level, flow, profiles=False).params["q"].value == tuned.params["q"].value
    fixed = ik.check(level, flow, set={"q": 1469.2, "r": 15098.5})
    assert fixed.Q[0, 0] == 1469.2
    assert ik.tune(level, flow, method="als", warn=False).params["q"].value > 0


def test_folder(level, flow, tmp_path):
    ik.tune(level, flow, output=tmp_path / "out")
    assert (tmp_path / "out/result.json").exists()


def test_progress(root):
    model = root / "examples/system7.yaml"
    y = ik.simulate(model, rows=200).values[:, :2]
    seen = []
    result = ik.tune(model, y, method="bayes", draws=2000, progress=lambda *what: seen.append(what), warn=False)
    assert seen and isinstance(seen[0][0], str) and result.ok in (True, False)

    def broken(*what):
        raise RuntimeError("mine")
    with pytest.raises(RuntimeError, match="mine"):
        ik.tune(model, y, method="bayes", draws=2000, progress=broken)


INTERRUPTED = """
import os, signal, threading, time, warnings
import numpy as np, identikal as ik
warnings.simplefilter("ignore", ik.FindingWarning)
def slow(theta):
    time.sleep(0.01)
    x, P, e, S = 0.0, 1e6, np.zeros(50), np.zeros(50)
    for k in range(50):
        P += theta["q"]; e[k] = np.sin(3 * k) - x; S[k] = P + theta["r"]; K = P / S[k]; x += K * e[k]; P *= 1 - K
    return e, S
def own():
    return ik.tune_external(slow, {"q": 1e3, "r": 1e-4}, limits={"q": (1e-9, None), "r": (1e-9, None)})
model = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1, min=0)]], R=[[ik.p("r", 1, min=0)]], initial="diffuse", step=1.0)
y = np.random.default_rng(1).normal(size=300_000)
def built_in():
    return ik.tune(model, y, starts=50, evaluation="time-varying")
threading.Timer(0.3, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
with warnings.catch_warnings(record=True) as seen:
    warnings.simplefilter("always", ik.StoppedWarning)
    result = {}()
print(result.status, result.params["r"].value > 0, [each.category.__name__ for each in seen])
"""


@pytest.mark.parametrize("which", ["own", "built_in"])
def test_interruption(which):
    said = subprocess.run([sys.executable, "-c", INTERRUPTED.replace("{}", which)], capture_output=True, text=True, timeout=60,
                          check=False)
    assert said.stdout.strip() == "not_converged True ['StoppedWarning']", said.stdout + said.stderr


def test_a_bar(root, monkeypatch):
    """tqdm, where it is installed."""
    drawn = []

    class Bar:
        def __init__(self, **given):
            self.n = 0.0

        def set_description(self, what, refresh):
            drawn.append(what)

        def refresh(self):
            assert 0 <= self.n <= 1

        def close(self):
            drawn.append("closed")
    monkeypatch.setitem(sys.modules, "tqdm", types.ModuleType("tqdm"))
    auto = types.ModuleType("tqdm.auto")
    auto.tqdm = Bar
    monkeypatch.setitem(sys.modules, "tqdm.auto", auto)
    model = root / "examples/system7.yaml"
    ik.tune(model, ik.simulate(model, rows=200).values[:, :2], method="bayes", draws=2000, progress=True, warn=False)
    assert len(drawn) > 1 and drawn[-1] == "closed"


def scalar_filter(theta, y):
    """A local level, in plain Python."""
    e, S = np.full(len(y), np.nan), np.ones(len(y))
    x, P = y[0], theta["r"]
    for k in range(1, len(y)):
        P += theta["q"]
        e[k], S[k] = y[k] - x, P + theta["r"]
        x += P / S[k] * e[k]
        P -= P * P / S[k]
    return e, S


def test_a_filter_of_ones_own(flow, tuned):
    own = ik.tune_external(scalar_filter, {"q": 1000.0, "r": 1000.0}, flow, limits={"q": (0, None), "r": (0, None)})
    assert own.status == "ok" and own.log_likelihood == pytest.approx(tuned.log_likelihood, abs=1e-6)
    for name in "qr":
        assert own.params[name].value == pytest.approx(tuned.params[name].value, rel=1e-6)
        assert own.params[name].se == pytest.approx(tuned.params[name].bound_se, rel=0.02)
    assert {test["id"] for test in own.tests} == {"nis", "ljung_box"}


def pendulum_filter(theta, y, step=0.05):
    """An extended Kalman filter, in plain numpy."""
    x, P = np.array([0.5, 0.0]), np.diag([0.01, 0.01])
    e, S = np.empty(len(y)), np.empty(len(y))
    for k, measured in enumerate(y):
        H = np.array([np.cos(x[0]), 0.0])
        e[k], S[k] = measured - np.sin(x[0]), H @ P @ H + theta["r"]
        K = P @ H / S[k]
        x, P = x + K * e[k], P - np.outer(K, H @ P)
        F = np.array([[1.0, step], [-9.81 * step * np.cos(x[0]), 1.0 - 0.1 * step]])
        x = np.array([x[0] + step * x[1], x[1] - step * 9.81 * np.sin(x[0]) - step * 0.1 * x[1]])
        P = F @ P @ F.T + np.diag([0.0, theta["q"]])
    return e, S


def test_an_extended_filter_of_ones_own():
    model = ik.FormulaModel({"phi": "phi + 0.05*w", "w": "w - 0.05*9.81*sin(phi) - 0.005*w"}, {"y": "sin(phi)"}, discrete=True,
                            step=0.05, parameters={"q": ik.free(0.01, min=0), "r": ik.free(0.01, min=0)},
                            process_variance={"w": "q"}, measurement_variance="r", initial={"phi": (0.5, 0.1), "w": (0, 0.1)})
    y = ik.simulate(model, rows=200, seed=4, set={"q": 0.002, "r": 0.0004}).values[:, 0]
    built_in = ik.tune(model, y, warn=False)
    own = ik.tune_external(pendulum_filter, {"q": 0.01, "r": 0.01}, y, limits={"q": (0, None), "r": (0, None)}, warn=False)
    assert own.log_likelihood == pytest.approx(built_in.log_likelihood, abs=1e-6)
    for name in "qr":
        assert own.params[name].value == pytest.approx(built_in.params[name].value, rel=1e-6)


def test_functions_that_are_called():
    def dynamics(x, theta):
        return [x[0] + 0.05 * x[1], x[1] - 0.05 * 9.81 * math.sin(x[0]) - 0.005 * x[1]]  # math: no formula
    of = np.random.default_rng(2)
    y = np.sin(0.4 * np.cos(np.arange(150) * 0.15)) + 0.02 * of.normal(size=150)
    y[40] = np.nan
    run = ik.extended_filter(dynamics, lambda x, theta: math.sin(x[0]), Q=lambda theta: np.diag([0.0, theta["q"]]),
                             R=lambda theta: theta["r"], mean=[0.5, 0.0], covariance=np.diag([0.01, 0.01]))
    own = ik.tune_external(run, {"q": 0.01, "r": 0.01}, y, limits={"q": (0, None), "r": (0, None)}, warn=False)
    typed = ik.tune_external(lambda theta, y: pendulum_filter(theta, y[:40]), {"q": 0.01, "r": 0.01}, y, warn=False)
    half = ik.tune_external(run, {"q": 0.01, "r": 0.01}, y[:40], warn=False)
    assert half.log_likelihood == pytest.approx(typed.log_likelihood, abs=1e-6)
    model = ik.FormulaModel({"phi": "phi + 0.05*w", "w": "w - 0.05*9.81*sin(phi) - 0.005*w"}, {"y": "sin(phi)"}, discrete=True,
                            step=0.05, parameters={"q": ik.free(0.01, min=0), "r": ik.free(0.01, min=0)},
                            process_variance={"w": "q"}, measurement_variance="r", initial={"phi": (0.5, 0.1), "w": (0, 0.1)})
    assert own.log_likelihood == pytest.approx(ik.tune(model, y, warn=False).log_likelihood, abs=1e-6)
    with_inputs = ik.extended_filter(lambda x, theta, u: [0.9 * x[0] + u[0]], lambda x, theta, u: x[0], Q=0.1, R=lambda theta: theta["r"],
                                     mean=[0.0], covariance=1.0)
    u = of.normal(size=(100, 1))
    assert ik.tune_external(with_inputs, {"r": 1.0}, (of.normal(size=100), u), limits={"r": (0, None)}, warn=False).params["r"].value > 0
    with pytest.raises(ik.InputError, match="2 x 2"):
        ik.tune_external(ik.extended_filter(dynamics, lambda x, theta: x[0], Q=1.0, R=1.0, mean=[0, 0], covariance=np.eye(2)),
                         {"q": 1.0}, y)


def test_several_outputs_of_ones_own():
    y = np.random.default_rng(1).normal(size=(400, 2)) @ np.diag([1.0, 3.0])
    own = ik.tune_external(lambda theta, y: (y, np.diag(theta)), [2.0, 2.0], y, limits=[(1e-9, None)] * 2)
    assert [p.value for p in own.params.values()] == pytest.approx((y ** 2).mean(0), rel=1e-6)
    each = ik.tune_external(lambda theta, y: (y, np.tile(np.diag(theta), (400, 1, 1))), [2.0, 2.0], y, limits=[(1e-9, None)] * 2)
    assert each.log_likelihood == own.log_likelihood


@pytest.mark.parametrize("answer", [
    None, 3, (np.zeros(5),), (np.zeros(5), np.zeros((5, 2, 2))), (np.zeros((5, 2)), np.eye(3)), (np.zeros((2, 2, 2)), 1.0),
    (np.zeros(5), np.zeros(4)), (np.zeros(5), -1.0), ("a", "b")])
def test_refused_filters(answer):
    with pytest.raises(ik.InputError):
        ik.tune_external(lambda theta: answer, {"q": 1.0})


def test_exceptions_of_ones_own():
    def broken(theta):
        raise ZeroDivisionError("mine")
    with pytest.raises(ZeroDivisionError, match="mine"):
        ik.tune_external(broken, {"q": 1.0})
    for start in ({}, {"q": "a"}, {"q": np.nan}, ["a"], object()):
        with pytest.raises(ik.InputError):
            ik.tune_external(scalar_filter, start)
    for limits in ({"p": (0, 1)}, {"q": 3}, {"q": ("a", None)}, {"q": (0, 1, 2)}):
        with pytest.raises(ik.InputError):
            ik.tune_external(scalar_filter, {"q": 1.0}, limits=limits)


def test_known_states():
    of = np.random.default_rng(3)
    x = np.cumsum(of.normal(size=2000))
    y = x + 2 * of.normal(size=2000)
    model = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1, min=0)]], R=[[ik.p("r", 1, min=0)]], initial="diffuse", step=1.0)
    fit = ik.tune(model, y, truth=x)
    error = (ik.filter(fit, y).states[:, 0] - x)[10:]
    (found,) = fit.references
    assert found["name"] == "x1" and found["rmse"] == pytest.approx(np.sqrt(np.mean(error ** 2)), rel=0.05)
    assert found["nees"] == pytest.approx(1, abs=0.15)
    assert fit.params["q"].value == ik.tune(model, y).params["q"].value
    wrong = ik.check(model, y, truth={"x1": x + 30.0}, set={"q": 1.0, "r": 4.0}, warn=False)
    assert wrong.references[0]["bias"] == pytest.approx(-30, abs=1)
    for truth in ({"x2": x}, x[:5], np.zeros((2000, 2)), {}):
        with pytest.raises(ik.InputError):
            ik.tune(model, y, truth=truth)


def test_threads(level, flow, tuned):
    found = []

    def work():
        for _ in range(20):
            found.append(ik.tune(level, flow).log_likelihood)
    threads = [threading.Thread(target=work) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert found == [tuned.log_likelihood] * 80


def test_memory_stays(level, flow):
    def used():
        with open("/proc/self/statm", encoding="ascii") as file:
            return int(file.read().split()[1]) * resource.getpagesize()

    def work(count):
        for _ in range(count):
            result = ik.tune(level, flow, starts=1, profiles=False)
            result.params, result.innovations, result.document  # noqa: B018
    work(300)
    before = used()
    work(1500)
    assert used() - before < 2e6


def test_random_calls():
    assert python_calls.answered(int(os.environ.get("IDENTIKAL_RANDOM_CALLS", "1500")), seed=7) > 20


def test_the_tool(tool):
    mine = subprocess.run([sys.executable, "-m", "identikal", "--version"], capture_output=True, text=True, check=False)
    assert mine.returncode == 0 and mine.stdout == subprocess.run([tool, "--version"], capture_output=True, text=True, check=False).stdout
    wrong = subprocess.run([sys.executable, "-m", "identikal", "tun"], capture_output=True, text=True, check=False)
    assert wrong.returncode == 2 and "tune" in wrong.stderr


def test_a_model_from_data():
    draw, x, y = np.random.default_rng(5), 0.0, []
    u = draw.normal(size=1200)
    for each in u:
        y.append(x + 0.2 * draw.normal())
        x = 0.8 * x + 0.5 * each
    found = ik.model(y, u=u, step=0.1, as_="oe", order="1:3")
    (pole,) = found.document["black_box"]["poles"]
    assert found.status == "ok" and abs(pole["real"] - 0.8) < 4.5 * pole["real_se"]
    assert ik.check(found.model, y, u=u, step=0.1).status == "ok"
    named = ik.model(np.column_stack([y, u]), columns=["speed", "voltage"], step=0.1, input="voltage", output="speed", order="1:3")
    assert named.document["black_box"]["input_names"] == ["voltage"]
    for mistake in ({"as_": "oe"}, {"u": u, "order": "3:1"}, {"u": u, "as_": "none"}):
        with pytest.raises(ik.InputError):
            ik.model(y, step=0.1, **mistake)
