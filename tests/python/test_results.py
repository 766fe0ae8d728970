"""What a result says, as a value."""
import copy
import json
import pickle
import subprocess

import numpy as np
import pytest

import identikal as ik


def test_the_nile(tuned):
    assert tuned.status == "ok" and tuned.ok and tuned.code == 0
    assert f"{tuned.params['q'].value:.2f} {tuned.params['r'].value:.2f}" == "1469.18 15098.52"
    assert tuned.log_likelihood == pytest.approx(-632.5456251, abs=1e-6)
    assert tuned.K == pytest.approx(np.array([[0.2670574925]]))
    assert tuned.Q[0, 0] == tuned.params["q"].value
    assert tuned.params["q"].verdict == "poorly_determined"
    assert tuned.innovations.shape == (100, 1) and np.isnan(tuned.innovations[0, 0])
    assert "1469.18" in tuned.summary() and tuned.summary() == str(tuned)


MODELS = [("nile.yaml", "nile.csv"), ("tracker.yaml", None), ("system7.yaml", None)]


@pytest.mark.parametrize("model, data", MODELS)
@pytest.mark.parametrize("options", [{}, {"starts": 1}, {"starts": 2, "seed": 3}, {"hold_out": "30%"}])
def test_numbers_of_the_command_line(root, tool, tmp_path, model, data, options):
    path = root / "examples" / model
    if data is None:
        subprocess.run([tool, "simulate", path, "-n", "500", "--seed", "5", "-o", tmp_path], check=True, capture_output=True)
        data = tmp_path / "simulated.csv"
    else:
        data = root / "data" / data
    typed = [text for key, value in options.items() for text in (f"--{key.replace('_', '-')}", str(value))]
    said = subprocess.run([tool, "tune", path, data, "--json", *typed], capture_output=True, text=True, check=False)
    expected = json.loads(said.stdout)
    result = ik.tune(path, data, warn=False, **options)
    assert result.code == said.returncode
    expected.pop("timing_s")
    document = result.to_dict()
    document.pop("timing_s")
    assert document == expected


TEMPLATES = {"constant-acceleration": None, "constant-acceleration-2d": None, "constant-velocity": None, "constant-velocity-2d": None,
             "local-level": None, "trend-season": None, "imu-bias": "gyro=0.1*sin(t)", "mass-spring-damper": "force=sin(t)",
             "pendulum": "torque=0.1*sin(t)", "thermal-rc": "heating=500*(1 + sin(t/4000))"}


@pytest.mark.parametrize("template, given", TEMPLATES.items())
def test_numbers_of_the_command_line_on_templates(tool, tmp_path, template, given):
    model, data = tmp_path / "model.yaml", tmp_path / "simulated.csv"
    model.write_text(subprocess.run([tool, "init", template], check=True, capture_output=True, text=True).stdout)
    more = ["--input", given] if given else []
    if template == "thermal-rc":
        more += ["--input", "outside=5 + sin(t/9000)"]
    subprocess.run([tool, "simulate", model, "-n", "200", "-o", tmp_path, *more], check=True, capture_output=True)
    said = subprocess.run([tool, "tune", model, data, "--json", "--starts", "1"], capture_output=True, text=True, check=False)
    expected, document = json.loads(said.stdout), ik.tune(model, data, starts=1, warn=False).to_dict()
    for each in (expected, document):
        each.pop("timing_s")
    assert document == expected


def test_arrays_give_the_numbers_of_files(root, tool, tmp_path):
    model = root / "examples/system7.yaml"
    subprocess.run([tool, "simulate", model, "-n", "2000", "-o", tmp_path], check=True, capture_output=True)
    y = ik.simulate(model, rows=2000).values[:, :2]
    file, arrays = ik.tune(model, tmp_path / "simulated.csv"), ik.tune(model, y)
    assert arrays.params == file.params and arrays.log_likelihood == file.log_likelihood


def test_pickle_copy_equality(tuned, level, flow):
    for other in (pickle.loads(pickle.dumps(tuned)), copy.copy(tuned), copy.deepcopy(tuned)):
        assert other == tuned and other.params == tuned.params and other.findings == tuned.findings
        assert np.array_equal(other.innovations, tuned.innovations, equal_nan=True)
        assert other.summary() == tuned.summary() and other.status == tuned.status
        assert other.log_likelihood == tuned.log_likelihood
    assert tuned == ik.tune(level, flow)
    assert tuned != ik.tune(level, flow[:90]) and tuned != 3
    assert ik.filter(pickle.loads(pickle.dumps(tuned)), flow) == ik.filter(tuned, flow)
    assert pickle.loads(pickle.dumps(level)) == level


def test_series_are_views_that_cannot_be_written_to(tuned):
    with pytest.raises(ValueError):
        tuned.innovations[1, 0] = 0.0
    innovations = ik.tune(tuned.model, np.arange(50.0) % 7, warn=False).innovations  # outlives its result
    assert np.isfinite(innovations[1:]).all()


def test_page(tuned):
    page = tuned.report()
    assert page.startswith("<!doctype html>") or page.startswith("<!DOCTYPE html>")
    assert "<iframe" in tuned._repr_html_()


def test_export(tuned):
    for form in ("cpp", "c", "matlab", "python", "yaml", "json"):
        assert "1469.176360" in tuned.export(form)
    with pytest.raises(ik.InputError, match="fortran"):
        tuned.export("fortran")


def test_jobs_on_results(tuned, level, flow):
    states, smoothed = ik.filter(tuned, flow), ik.smooth(tuned, flow)
    assert states.states.shape == smoothed.states.shape == (100, 1)
    assert states.states[-1, 0] == pytest.approx(smoothed.states[-1, 0])
    assert smoothed.state_sd[50, 0] < states.state_sd[50, 0]
    assert ik.check(tuned, flow).status == "ok"
    assert ik.check(level, flow).status == "rejected"
    assert ik.validate(tuned, flow, warn=False).status == "ok"
    other = ik.tune(ik.LinearModel(A=0.5, C=1, Q=[[ik.p("q", 1e4, min=0)]], R=[[ik.p("r", 1e4, min=0)]], step=1.0,
                                   parameters=None), flow, warn=False)
    assert "compare" in ik.compare(tuned, other, warn=False).summary()
    ranked = ik.compare(level, tuned, other, data=flow, warn=False)
    assert ranked.status == "ok" and "<model 2>" in ranked.message
    for given in ((tuned, level), (tuned, 3)):
        with pytest.raises(ik.InputError):
            ik.compare(*given)
    with pytest.raises(ik.InputError):
        ik.compare(level, data=flow)
    assert ik.bound(tuned, rows=400).params["q"].bound_se == pytest.approx(ik.bound(tuned, rows=100).params["q"].bound_se / 2, rel=0.2)
    drawn = ik.simulate(tuned, rows=30, seed=2)
    assert drawn.values.shape == (30, 2) and drawn.columns == ["y", "time [s]"]
    assert np.array_equal(drawn.values, ik.simulate(tuned, rows=30, seed=2).values)


def test_online_filter(tuned, flow):
    online, whole = tuned.online_filter(), ik.filter(tuned, flow)
    for k, y in enumerate(flow):
        state, sd, innovation = online.step(y)
        assert state == pytest.approx(whole.states[k], rel=1e-12) and sd == pytest.approx(whole.state_sd[k], rel=1e-12)
    for bad in ([1.0, 2.0], "a", np.inf):
        with pytest.raises(ik.InputError):
            online.step(bad)


def test_frame(tuned):
    pandas = pytest.importorskip("pandas")
    frame = tuned.to_frame()
    assert frame.loc["q", "value"] == tuned.params["q"].value and list(frame.index) == ["q", "r"]
    drawn = ik.simulate(tuned, rows=5).to_frame()
    assert isinstance(drawn, pandas.DataFrame) and drawn.shape == (5, 2)


def test_plot(tuned):
    pytest.importorskip("matplotlib")
    assert len(tuned.plot().axes) == 2


def test_findings_are_warnings(tuned, flow):
    with pytest.warns(ik.FindingWarning, match="proves nothing") as seen:
        result = ik.validate(tuned, flow)
    assert seen[0].filename == __file__
    assert result.findings[0].code == "own_data"


def test_an_interval_without_an_end_stays_one():
    x = np.arange(1.0, 13.0)
    noise = np.array([0.5, -0.7, 0.2, 0.9, -0.4, -0.6, 0.8, -0.1, 0.3, -0.9, 0.6, 0.4])
    model = ik.Model.from_text("""identikal: 1
name: beginning of a curve
model: static
parameters: {height: {value: 10}, rate: {value: 0.1}, s: {value: 1, min: 0}}
inputs: {x: {column: x}}
outputs: {y: {column: y, equals: height*(1 - exp(-rate*x))}}
noise: {measurement: {sd: {y: s}}}
""")
    fit = ik.fit(model, 20 * (1 - np.exp(-0.05 * x)) + noise, u=x)
    low, high = fit.params["height"].interval
    assert 5 < low < fit.params["height"].value and high == np.inf
    assert pickle.loads(pickle.dumps(fit)).params["height"].interval == (low, high)
