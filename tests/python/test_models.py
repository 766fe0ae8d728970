"""Models that are written in Python."""
import numpy as np
import pytest

import identikal as ik


def test_matrices_of_formulas():
    tau = ik.p("tau", 2.0, min=0.1)
    model = ik.LinearModel(A=[[np.exp(-0.1 / tau)]], C=1, Q=[[0.2 * (1 - np.exp(-0.2 / tau))]], R=[[0.1]], step=0.1)
    drawn = ik.simulate(model, rows=4000, seed=1, set={"tau": 1.5})
    fit = ik.tune(model, drawn.values[:, 0])
    assert abs(fit.params["tau"].value - 1.5) < 4 * fit.params["tau"].se


def test_structures():
    for structure in ("diagonal", "full", "scaled-identity"):
        model = ik.LinearModel(A=[[0.9, 0.1], [0, 0.8]], C=np.eye(2), Q=structure, R="diagonal", step=1.0)
        y = ik.simulate(model, rows=300).values[:, :2]
        assert ik.tune(model, y, starts=1, warn=False).Q.shape == (2, 2)


def motion(x, p):
    return [x.w, -9.81 / p.l * np.sin(x.phi) - p.d * x["w"]]


def test_functions_are_formulas():
    shared = dict(parameters={"l": ik.free(0.8, min=0.1, max=5), "d": ik.free(0.3, min=0)}, process_sd={"w": 0.05},
                  measurement_sd=0.01, initial={"phi": (0.3, 0.1), "w": 0}, step=0.02)
    traced = ik.FormulaModel(motion, lambda x: x[0], states=["phi", "w"], output_names=["angle"], **shared)
    typed = ik.FormulaModel({"phi": "w", "w": "-9.81/l*sin(phi) - d*w"}, {"angle": "phi"}, **shared)
    y = ik.simulate(typed, rows=300, seed=2).values[:, 0]
    a, b = ik.fit(traced, y, warn=False), ik.fit(typed, y, warn=False)
    assert a.params["l"].value == pytest.approx(b.params["l"].value, rel=1e-9)
    assert a.log_likelihood == pytest.approx(b.log_likelihood, abs=1e-9)


def test_what_numpy_does_to_formulas():
    x, y = ik.Expression("x"), ik.Expression("y")
    assert (2 - x / y ** 2).text == "(2.0 - (x / (y ^ 2.0)))"
    assert np.where(x > 0, np.sqrt(x), -x).text == "if((x > 0.0), sqrt(x), (-x))"
    assert np.arctan2(y, x).text == "atan2(y, x)" and abs(x).text == "abs(x)"
    assert np.clip(x, -1, 1).text == "min(max(x, (-1.0)), 1.0)"
    assert [e.text for e in np.array([[1.0, 0.0], [0.5, 2.0]]) @ np.array([x, y], dtype=object)][1] == \
        "((0.5 * x) + (2.0 * y))"
    assert [e.text for e in np.sin(np.array([x, y], dtype=object))] == ["sin(x)", "sin(y)"]
    assert [e.text for e in x * np.array([1.0, 2.0])] == ["(x * 1.0)", "(x * 2.0)"]
    for mistake in (lambda: x and y, lambda: float(x), lambda: np.cbrt(x), lambda: x + object(),
                    lambda: x + np.inf, lambda: np.sum(np.where(x > 0, x, object()))):
        with pytest.raises(ik.InputError):
            mistake()


@pytest.mark.parametrize("make", [
    lambda: ik.LinearModel(A=[[1.0, 2.0], [1.0]], C=1), lambda: ik.LinearModel(A=[1.0, 2.0], C=1),
    lambda: ik.LinearModel(A=[[np.nan]], C=1), lambda: ik.LinearModel(A=[[1j]], C=1), lambda: ik.LinearModel(A=None, C=1),
    lambda: ik.LinearModel(A=1, C=1, Q="wide"), lambda: ik.LinearModel(A=1, C=1, initial=3),
    lambda: ik.LinearModel(A=[[ik.p("a", 1)]], C=[[ik.p("a", 2)]]), lambda: ik.p("", 1), lambda: ik.p("a", object()),
    lambda: ik.FormulaModel(lambda x: [x.nothing], {"y": "x"}, states=["x"]), lambda: ik.FormulaModel(3, {"y": "x"}, states=["x"]),
    lambda: ik.FormulaModel(lambda x: [x[0], x[0]], {"y": "x"}, states=["x"]), lambda: ik.Car(1500, 1, 1.5),
    lambda: ik.Car(1500, 1, 1.5, steering="wheel", steering_ratio=16), lambda: ik.Model(3), lambda: ik.Model("a\nb")])
def test_mistakes_in_python(make):
    with pytest.raises(ik.InputError):
        make()


@pytest.mark.parametrize("model, match", [
    (ik.LinearModel(A=np.eye(2), C=[[1.0]], step=1.0), "2"),
    (ik.LinearModel(A=1, C=1, Q=[["q"]], step=1.0), "q"),
    (ik.Model.from_text("identikal: 1\nA: [[1]]\n"), "<model>:1"),
    (ik.Model("/nothing/there.yaml"), "there.yaml")])
def test_mistakes_in_models(model, match):
    with pytest.raises(ik.InputError, match=match):
        ik.tune(model, np.arange(20.0))


def test_templates():
    drawn = ik.simulate(ik.Model.template("constant-velocity"), rows=50)
    assert len(drawn.values) == 50
    with pytest.raises(ik.InputError, match="battery"):
        ik.Model.template("car")


def test_place_of_a_mistake():
    with pytest.raises(ik.InputError) as caught:
        ik.tune(ik.Model.from_text("identikal: 1\ntime: {step: 1}\nA: [[b]]\nC: [[1]]\nQ: [[1]]\nR: [[1]]\noutputs: [{name: y}]\n"), np.arange(9.0))
    assert caught.value.line == 3 and caught.value.path == "<model>"


def test_a_car(root):
    car = ik.Car(mass=1446, a=0.987, b=1.525, steering_ratio=21, outputs={"r": {"column": "yaw_rate", "unit": "deg/s"}, "vy": "vy"},
                 inputs={"steering_wheel_angle": {"column": "swa", "unit": "deg"}, "vx": {"column": "speed", "unit": "km/h"}},
                 sd={"r": 0.01, "vy": 0.03}, tyre={"curve": "linear"}, use_when="vx > 5")
    fit = ik.fit(car, root / "data/severe_lane_change.csv")
    same = ik.fit(root / "examples/severe_lane_change.yaml", root / "data/severe_lane_change.csv")
    assert fit.params["Cf"].value == pytest.approx(same.params["Cf"].value, rel=1e-6)
    assert fit.params["Cf"].unit == "N/rad" or fit.params["Cf"].unit == ""


def test_doses_are_none_where_an_input_is_missing():
    """And a steady state before the recording is the one that its inputs make."""
    model = ik.FormulaModel({"gut": "-k*gut", "blood": "k*gut - 0.2*blood + rate"}, {"seen": "blood"}, inputs=["amount", "rate"],
                            parameters={"k": ik.free(1, min=0.01, max=10), "s": ik.free(0.1, min=1e-3)}, measurement_sd="s",
                            initial="steady-state", doses={"gut": "amount"}, irregular=True)
    t = np.arange(0.0, 12.0, 0.5)
    y = 2.0 + 3 * (t > 1) * (np.exp(-0.2 * (t - 1)) - np.exp(-(t - 1))) + 0.05 * np.random.default_rng(1).standard_normal(len(t))
    u = np.full((len(t), 2), np.nan)
    u[2, 0], u[:, 1] = 2.4, 0.4
    of_gaps = ik.fit(model, y, u=u, time=t)
    of_zeros = ik.fit(model, y, u=np.nan_to_num(u), time=t)
    assert of_gaps.log_likelihood == of_zeros.log_likelihood
    assert of_gaps.params["k"].value == pytest.approx(1.0, abs=4 * of_gaps.params["k"].se)
    assert np.asarray(ik.filter(model, y, u=u, time=t).states)[0] == pytest.approx([0.0, 2.0], abs=1e-6)


def test_a_model_file_is_read_as_it_is_now(tmp_path, flow, root):
    path = tmp_path / "level.yaml"
    text = (root / "examples/nile.yaml").read_text()
    path.write_text(text)
    model = ik.Model(path)
    assert set(ik.tune(model, flow, starts=1, profiles=False).params) == {"q", "r"}
    path.write_text(text.replace("R: [[r]]", "R: [[15000]]").replace("  r: {value: 1000, min: 0, role: measurement-noise}\n", ""))
    assert set(ik.tune(model, flow, starts=1, profiles=False).params) == {"q"}
