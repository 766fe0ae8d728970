"""Arrays and tables of every kind: the right numbers, or InputError."""
import numpy as np
import pytest

import identikal as ik

try:
    import pandas
except ImportError:
    pandas = None
needs_pandas = pytest.mark.skipif(pandas is None, reason="without pandas")


def likelihood(model, data, **more):
    return ik.tune(model, data, starts=1, profiles=False, warn=False, **more).log_likelihood


@pytest.fixture(scope="module")
def expected(level, flow):
    return likelihood(level, flow)


class Wrapped:
    def __init__(self, values):
        self.values = values

    def __array__(self, dtype=None):
        return np.asarray(self.values, dtype=dtype)


@pytest.mark.parametrize("form", [
    list, tuple, lambda y: y[:, None], lambda y: np.asfortranarray(y[:, None]), lambda y: y.astype(np.int64),
    lambda y: y.astype(np.float32), lambda y: y.astype(np.longdouble), lambda y: y.astype(object), Wrapped,
    lambda y: np.repeat(y, 3)[::3], lambda y: y[::-1].copy()[::-1], lambda y: np.broadcast_to(y, y.shape),
    lambda y: y.astype(">f8"), lambda y: memoryview(y.copy()), lambda y: np.ma.masked_array(y, mask=np.zeros(len(y), bool))])
def test_forms_of_the_same_samples(level, flow, expected, form):
    assert likelihood(level, form(flow)) == expected


def test_read_only(level, flow, expected):
    y = flow.copy()
    y.flags.writeable = False
    assert likelihood(level, y) == expected


def test_samples_are_not_changed(level, flow):
    y = flow.copy()
    ik.tune(level, y, starts=1)
    assert np.array_equal(y, flow)


@pytest.mark.parametrize("form", [
    lambda y: np.ma.masked_array(y, mask=np.arange(len(y)) == 7),
    lambda y: [None if i == 7 else x for i, x in enumerate(y)],
    lambda y: np.where(np.arange(len(y)) == 7, np.nan, y)])
def test_missing(level, flow, form):
    y = flow.copy()
    y[7] = np.nan
    assert likelihood(level, form(flow)) == likelihood(level, y)
    assert likelihood(level, form(flow)) != likelihood(level, flow)


@pytest.mark.parametrize("bad", [
    np.array(3.0), 3.0, [], np.zeros((0, 1)), np.zeros((5, 1, 1)), np.zeros((10, 2)), np.zeros((1, 10)), ["a", "b"],
    np.array(["1.0", "2.0"]), np.zeros(5, complex), np.array([1.0, object()], dtype=object), {"y": 1}, object(),
    np.array([1.0, np.inf, 2.0]), np.zeros(9, "datetime64[s]"), [[1.0], [1.0, 2.0]], np.zeros(3, dtype=[("a", float)])])
def test_refused(level, bad):
    with pytest.raises(ik.InputError):
        ik.tune(level, bad)


def test_refused_arguments(level, flow):
    for more in ({"time": np.arange(7.0)}, {"time": np.full(100, np.nan)}, {"time": np.arange(100.0)[::-1]}, {"u": flow},
                 {"step": -1.0}, {"step": 2.0}, {"step": "a"}, {"units": {"y": "m"}}, {"columns": ["a", "b"]}):
        with pytest.raises(ik.InputError):
            ik.tune(level, flow, **more)


def test_no_copy_of_what_is_float64_in_rows(flow):
    for y in (flow.copy(), np.zeros((1000, 3))):
        assert np.shares_memory(ik.Recording(y).y, y)


def test_times(flow, expected):
    model = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1000, min=0)]], R=[[ik.p("r", 1000, min=0)]], initial="diffuse")
    days = np.datetime64("2020-01-01") + np.arange(100).astype("timedelta64[s]")
    for time in (np.arange(100), days, np.arange(100) * np.timedelta64(1000, "ms")):
        assert likelihood(model, flow, time=time) == pytest.approx(expected, abs=1e-9)
    with pytest.raises(ik.InputError, match="times, or a step"):
        ik.tune(model, flow)


def test_several_recordings(level, flow, root):
    both = likelihood(level, [flow[:50], flow[50:]])
    assert likelihood(level, [ik.Recording(flow[:50]), ik.Recording(flow[50:])]) == both
    path = root / "data/nile.csv"
    assert likelihood(ik.Model(root / "examples/nile.yaml"), path) == likelihood(level, flow)


@needs_pandas
def test_tables(level, flow, expected):
    series = pandas.Series(flow, name="y")
    for data in (series, series.to_frame(), pandas.DataFrame({"text": ["a"] * 100, "y": series}),
                 pandas.DataFrame({"y": series.astype("Int64")}), pandas.Series(flow), series.convert_dtypes()):
        assert likelihood(level, data) == expected
    with pytest.raises(ik.InputError, match="volume"):
        ik.tune(level, pandas.DataFrame({"volume": flow}))


@needs_pandas
def test_missing_in_tables(level, flow):
    y = flow.copy()
    y[7] = np.nan
    frame = pandas.DataFrame({"y": pandas.array([None if i == 7 else int(x) for i, x in enumerate(flow)], dtype="Int64")})
    assert likelihood(level, frame) == likelihood(level, y)


@needs_pandas
def test_index_is_time(flow, expected):
    model = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1000, min=0)]], R=[[ik.p("r", 1000, min=0)]], initial="diffuse")
    for index in (pandas.date_range("2020-01-01", periods=100, freq="s"), np.arange(100.0),
                  pandas.to_timedelta(np.arange(100), unit="s")):
        assert likelihood(model, pandas.DataFrame({"y": flow}, index=index)) == pytest.approx(expected, abs=1e-9)


@needs_pandas
def test_a_table_of_a_car_is_the_file(root):
    model = ik.Model(root / "examples/severe_lane_change.yaml")
    path = root / "data/severe_lane_change.csv"
    of_file, of_table = ik.fit(model, path), ik.fit(model, pandas.read_csv(path, comment="#"))
    assert of_table.params == of_file.params
    in_radians = pandas.read_csv(path, comment="#").rename(columns={"yaw_rate [deg/s]": "yaw_rate"})
    assert ik.fit(model, in_radians, units={"yaw_rate": "deg/s"}).params == of_file.params
