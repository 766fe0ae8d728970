"""A verb on each of many recordings: what single calls give, whoever does the work."""
import os
import signal
import threading
import time

import numpy as np
import pytest

import identikal as ik


@pytest.fixture(scope="module")
def series():
    of = np.random.default_rng(1)
    return [np.cumsum(30 * of.normal(size=150)) + 100 * of.normal(size=150) for _ in range(9)]


@pytest.mark.parametrize("threads", [1, 2, 5, None])
def test_results_are_those_of_single_calls(level, series, threads):
    together = list(ik.each("tune", level, series, threads=threads))
    assert len(together) == len(series)
    for y, result in zip(series, together):
        alone = ik.tune(level, y, warn=False)
        assert result.params == alone.params and result.log_likelihood == alone.log_likelihood
        assert result.message == alone.message and np.array_equal(result.innovations, alone.innovations, equal_nan=True)


def test_what_is_no_recording_is_a_result_that_says_so(level, series):
    given = [series[0], np.array(["a"]), np.full(20, np.nan), "nowhere.csv", None, 3.0, series[1]]
    codes = [(each.code, each.message) for each in ik.each("tune", level, given)]
    assert [code for code, _ in codes] == [0, 2, 2, 2, 2, 2, 0]
    assert "dtype <U1" in codes[1][1] and "no number" in codes[2][1] and "nowhere.csv" in codes[3][1]
    failed = list(ik.each("tune", level, given))[3]
    assert not failed.ok and failed.status is None and failed.params == {} and failed.findings == []


def test_forms_of_many(level, series):
    expected = [each.params for each in ik.each("tune", level, series[:3])]
    assert [each.params for each in ik.each("tune", level, np.array(series[:3]))] == expected
    assert [each.params for each in ik.each("tune", level, (y for y in series[:3]))] == expected
    assert [each.params for each in ik.each("tune", level, [ik.Recording(y) for y in series[:3]])] == expected
    [joint] = ik.each("tune", level, [series[:3]])
    assert joint.params == ik.tune(level, series[:3], warn=False).params
    assert list(ik.each("tune", level, [])) == []


def test_columns_of_a_table(level, series):
    pandas = pytest.importorskip("pandas")
    table = pandas.DataFrame({"left": series[0], "right": series[1]})
    assert [each.params for each in ik.each("tune", level, table)] == [each.params for each in ik.each("tune", level, series[:2])]


def test_other_verbs(level, series):
    tuned = ik.tune(level, series[0], warn=False)
    for filtered, y in zip(ik.each("filter", tuned, series), series):
        assert np.array_equal(filtered.states, ik.filter(tuned, y, warn=False).states)
    for validated, y in zip(ik.each("validate", tuned, series[:3]), series):
        assert validated.message == ik.validate(tuned, y, warn=False).message


@pytest.mark.parametrize("arguments, more, words", [
    (("tun", 0, []), {}, "'tun' on each"), (("tune", 0, []), {"strats": 1}, "did you mean 'starts'"),
    (("tune", 0, {"a": [1.0]}), {}, "its values"), (("tune", 0, "x.csv"), {}, "a str as recordings"),
    (("tune", 0, np.zeros(3)), {}, "a ndarray as recordings"), (("tune", 3, []), {}, "a int as a model"),
    (("validate", 0, []), {}, "to validate"), (("model", 0, []), {}, "with a model"),
    (("tune", 0, []), {"threads": 0}, "threads=0"), (("tune", 0, []), {"threads": 2.0}, "threads=2.0"),
])
def test_mistakes_are_told_before_any_is_done(level, arguments, more, words):
    verb, model, recordings = arguments
    with pytest.raises(ik.InputError, match=words):
        ik.each(verb, level if model == 0 else model, recordings, **more)


def test_progress_and_an_early_end(level, series):
    told = []
    assert len(list(ik.each("tune", level, series, threads=2, progress=lambda *each: told.append(each)))) == 9
    assert told[-1][:2] == ("9 of 9 recordings", 1.0) and [each[1] for each in told] == sorted(each[1] for each in told)
    with pytest.warns(ik.StoppedWarning, match="stopped after 1 of 9"):
        assert len(list(ik.each("tune", level, series, threads=1, progress=lambda *each: False))) == 1


@pytest.mark.parametrize("threads", [1, 2])
def test_ctrl_c_ends_it(threads):
    of = np.random.default_rng(1)
    model = ik.LinearModel(A=[[ik.p("a", 0.5, min=-1, max=1), 1], [0, ik.p("b", 0.1, min=-1, max=1)]], C=[[1, 0]], Q=[[ik.p("q", 1, min=0), 0], [0, ik.p("s", 1, min=0)]],
                           R=[[ik.p("r", 1, min=0)]], step=1.0)
    recordings = [of.normal(size=100_000) * np.linspace(1, 3, 100_000) for _ in range(200)]
    threading.Timer(0.5, os.kill, (os.getpid(), signal.SIGINT)).start()
    begin, done = time.monotonic(), 0
    with pytest.raises(KeyboardInterrupt):
        for _ in ik.each("tune", model, recordings, threads=threads):
            done += 1
    assert done < 200 and time.monotonic() - begin < 10.0
