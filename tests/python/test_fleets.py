"""Many recordings: what the command line gives, from arrays, tables and files."""
import subprocess
import threading
import time
import warnings

import numpy as np
import pytest

import identikal as ik

OPTIONS = {"workers": 2, "starts": 1, "profiles": False}


@pytest.fixture(scope="module")
def records():
    of = np.random.default_rng(1)
    return {f"sensor {k}": np.cumsum(30 * of.normal(size=200)) + 100 * of.normal(size=200) for k in range(6)}


@pytest.fixture(scope="module")
def fleet(level, records, tmp_path_factory):
    return ik.fleet("tune", level, records, tmp_path_factory.mktemp("fleet") / "sensors.store", **OPTIONS)


def test_rows_are_those_of_single_fits(fleet, level, records):
    assert fleet.complete and len(fleet) == 6 and fleet.failed == {}
    assert fleet.statuses == {"ok": 6}
    for k, y in enumerate(records.values()):
        alone = ik.tune(level, y, starts=1, profiles=False)
        assert fleet["q"][k] == alone.params["q"].value and fleet["r_se"][k] == alone.params["r"].se
        assert fleet["log_likelihood"][k] == alone.log_likelihood


def test_the_table_is_that_of_the_command_line(fleet, tool):
    assert fleet.export() == subprocess.run([tool, "fleet", "export", fleet.path], capture_output=True, text=True, check=True).stdout
    assert fleet.summary() == subprocess.run([tool, "fleet", "status", fleet.path], capture_output=True, text=True, check=True).stdout
    assert "<html" in fleet.report() and "<iframe" in fleet._repr_html_() and "2 of" not in repr(fleet)
    with pytest.raises(ik.InputError, match="no column 'Q'"):
        fleet["Q"]


def test_what_holds_is_not_done_again(fleet, level, records, tool):
    def seconds():
        import sqlite3
        with sqlite3.connect(fleet.path) as store:
            return store.execute("SELECT recording, finished, attempts FROM job ORDER BY number").fetchall()
    before, rows = seconds(), fleet.export()
    changed = {**records, "sensor 3": records["sensor 3"] + 1.0}
    time.sleep(1.1)  # times are whole seconds
    again = ik.fleet("tune", level, changed, fleet.path, **OPTIONS)
    differing = [a[0] for a, b in zip(before, seconds()) if a != b]
    assert len(differing) == 1 and "sensor 3" in differing[0]
    assert np.isclose(again["q"][3], fleet["q"][3], rtol=1e-6)
    ik.fleet("tune", level, records, fleet.path, **OPTIONS)
    assert ik.Fleet(fleet.path).export() == rows


def test_population(fleet):
    q = fleet.population()["q"]
    assert q.logarithm and q.interval[0] < 900.0 < q.interval[1] and q.spread_interval[0] == 0.0
    assert set(q.units) == {f"sensor {k}" for k in range(6)} == set(fleet["unit"]) and q.strangers == []
    assert 0.0 < q.p_same < 1.0


def test_rows_with_units_options_and_covariates(level, records, tmp_path):
    rows = [{"recording": y, "name": f"day {k}", "unit": f"car {k}", "mileage": 1000 * k, "options": "--set q=500"}
            for k, y in enumerate(records.values())]
    rows.append({"recording": tmp_path / "is not there.csv", "unit": "car 9", "mileage": 0})
    fleet = ik.fleet("tune", level, rows, tmp_path / "days.store", retries=0, **OPTIONS)
    assert fleet["unit"][2] == "car 2" and fleet["mileage"][5] == 5000.0
    assert fleet.statuses == {"ok": 6, "failed": 1}
    (missing, why), = fleet.failed.items()
    assert missing.endswith("is not there.csv") and "is not there.csv" in why
    assert fleet.population()["q"].trends[0]["covariate"] == "mileage"
    assert np.isnan(fleet["q"][6])


def test_tables_and_files(level, records, tmp_path):
    pandas = pytest.importorskip("pandas")
    for k, y in enumerate(records.values()):
        pandas.DataFrame({"y": y}).to_csv(tmp_path / f"{k}.csv", index=False)
    model = ik.Model.from_text(level.text)
    by_pattern = ik.fleet("tune", model, str(tmp_path / "*.csv"), tmp_path / "a.store", **OPTIONS)
    table = pandas.DataFrame({"recording": [str(tmp_path / f"{k}.csv") for k in range(6)], "unit": list("aabbcc")})
    by_table = ik.fleet("tune", model, table, tmp_path / "b.store", **OPTIONS)
    assert np.array_equal(by_pattern["q"], by_table["q"]) and len(by_table) == 6
    frame = by_table.to_frame()
    assert list(frame["unit"]) == list("aabbcc") and frame["q"].dtype == float


def test_paths_are_those_of_the_folder_where_it_is_called(level, records, tmp_path, monkeypatch):
    """Joined ones too, with a store elsewhere."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    for name in ("y", "z"):
        (tmp_path / f"logs/{name}.csv").write_text(f"t,{name}\n" + "".join(f"{k},{value!r}\n" for k, value in enumerate(records["sensor 0"].tolist())))
    model = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1, min=0)]], R=[[ik.p("r", 1, min=0)]], initial="diffuse", time={"column": "t", "unit": "s"})
    fleet = ik.fleet("tune", model, ["logs/y.csv+logs/z.csv", "logs/y.csv"], "stores/a.store", starts=1)
    assert fleet.statuses == {"ok": 2} and fleet["q"][0] == fleet["q"][1]


def test_samples_come_back_to_the_last_bit(tmp_path):
    """Names with commas, units, missing samples in a single column, inputs, times."""
    model = ik.LinearModel(A=[[0.5]], B=[[1.0]], C=[[1.0]], Q=[[ik.p("q", 1, min=0)]], R=[[0.5]], inputs={"u": {"column": 'u "as set"; raw'}},
                           outputs={"y": {"column": "#y"}}, step=0.1)
    of = np.random.default_rng(4)
    u, y = of.normal(size=300), of.normal(size=300) * 1e-7
    y[[3, 40, 41]] = np.nan
    alone = ik.tune(model, y, u=u, starts=1, warn=False)
    fleet = ik.fleet("tune", model, [ik.Recording(y, u=u)], tmp_path / "one.store", starts=1)
    assert fleet["log_likelihood"][0] == alone.log_likelihood and fleet["rows"][0] == 300
    level = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1, min=0)]], R=[[ik.p("r", 1, min=0)]], initial="diffuse", step=1.0)
    alone = ik.tune(level, y, starts=1)
    assert ik.fleet("tune", level, [y], starts=1)["log_likelihood"][0] == alone.log_likelihood


def test_validate_takes_a_result(tuned, records, tmp_path):
    fleet = ik.fleet("validate", tuned, list(records.values()), tmp_path / "v.store", workers=2)
    alone = ik.validate(tuned, records["sensor 0"], warn=False)
    assert fleet["log_likelihood"][0] == alone.log_likelihood or np.isnan(fleet["log_likelihood"][0])
    assert fleet["status"][0] == alone.status and len(fleet) == 6


def test_without_a_store_the_files_go(level, records):
    import os
    fleet = ik.fleet("tune", level, records, **OPTIONS)
    path = fleet.path
    assert os.path.exists(path) and len(fleet) == 6
    del fleet
    assert not os.path.exists(path)


def test_stopped_and_gone_on_with(level, tmp_path):
    of = np.random.default_rng(2)
    many = [np.cumsum(of.normal(size=3000)) + of.normal(size=3000) for _ in range(300)]  # 2 s of work or more
    told = []

    def enough(what, share, value):
        told.append((what, share))
        return len(told) < 3
    with pytest.warns(ik.StoppedWarning, match="resume"):
        fleet = ik.fleet("tune", level, many, tmp_path / "many.store", progress=enough, workers=1, starts=20)
    assert len(told) == 3 and not fleet.complete and len(fleet) < 300
    fleet.resume(workers=2)
    assert fleet.complete and len(fleet) == 300


def test_other_threads_run_meanwhile(level, records):
    counted = []
    stop = threading.Event()

    def count():
        while not stop.is_set():
            counted.append(1)
            time.sleep(0.001)
    thread = threading.Thread(target=count)
    thread.start()
    ik.fleet("tune", level, records, **OPTIONS)
    stop.set()
    thread.join()
    assert len(counted) > 50


@pytest.mark.parametrize("given, message", [
    (("shape", None, ["a.csv"]), "a fleet of 'shape'; expected one of tune, fit, check, validate"),
    (("tune", 3, ["a.csv"]), "a int as a model"),
    (("tune", "level", []), "a fleet without recordings"),
    (("tune", "level", 3), "a int as the recordings of a fleet"),
    (("tune", "level", [1.0, 2.0]), "a list as the recordings of a fleet"),
    (("tune", "level", [{"unit": "a"}]), "row 1 of a fleet has no 'recording'"),
    (("tune", "level", {"a/b": np.zeros(9)}), "'a/b' as the name of a recording"),
    (("tune", "level", {"a": np.array(["x"])}), "y is of dtype|holds what is no number"),
    (("tune", "level", [np.zeros((9, 2))]), "recording '1': .*2 outputs"),
    (("validate", "level", [np.zeros(9)]), "a LinearModel for a fleet of 'validate'; expected what tune"),
])
def test_mistakes_are_one_line(level, tmp_path, given, message):
    verb, model, recordings = given
    with pytest.raises(ik.InputError, match=message) as mistake:
        ik.fleet(verb, level if model == "level" else model, recordings, tmp_path / "x.store")
    assert "\n" not in str(mistake.value)


def test_none_that_can_be_done_is_a_fleet_of_failures(level, tmp_path):
    fleet = ik.fleet("tune", level, {"a": np.full(30, np.nan), "b": np.zeros(30)}, tmp_path / "f.store", retries=0)
    assert fleet.complete and fleet.statuses == {"failed": 2} and len(fleet.failed) == 2
    assert fleet.population() == {}


def test_a_store_that_cannot_be_written(level, records, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(ik.IdentikalError, match="file"):
        ik.fleet("tune", level, records, tmp_path / "file" / "x.store")


def test_options_are_those_of_the_command_line(level, records, tmp_path):
    with pytest.raises(ik.InputError, match="startz"):
        ik.fleet("tune", level, records, tmp_path / "x.store", startz=3)
    with pytest.raises(ik.InputError, match="no store|cannot|No such"):
        ik.Fleet(tmp_path / "nothing.store")
    (tmp_path / "text.store").write_text("text")
    with pytest.raises(ik.InputError, match="store"):
        ik.Fleet(tmp_path / "text.store")


def test_slurm_calls_this_package(level, records, tmp_path, capsys):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ik.fleet("tune", level, records, tmp_path / "s.store", engine="slurm", shards=3, dry_run=True)
    said = capsys.readouterr().out
    assert "'-m' 'identikal' fleet resume" in said and "--array=1-3" in said
