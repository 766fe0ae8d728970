"""What does Python cost? tests/bench/python_bench.py [FITS [CALL_BENCH]]; the package on PYTHONPATH, statsmodels installed.

Prints: a call of tune with its parts, FITS fits of short recordings (each of its own) beside the same through the module's
raw function and by each(), two threads beside one, memory for 10^7 rows, with CALL_BENCH each() beside a loop of tune_ml() in C++,
and time, log-likelihood, estimates and errors beside statsmodels on three models.
"""
import os
import statistics
import subprocess
import sys
import tempfile
import threading
import time
import warnings

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
import numpy as np  # noqa: E402  (after the number of threads)

import identikal as ik  # noqa: E402
from identikal import _identikal  # noqa: E402

ROOT = os.path.join(os.path.dirname(os.path.abspath(__file__)), "../..")
FLOW = np.loadtxt(os.path.join(ROOT, "data/nile.csv"), delimiter=",", skiprows=1)[:, -1].copy()
LEVEL = ik.LinearModel(A=1, C=1, Q=[[ik.p("q", 1000, min=0)]], R=[[ik.p("r", 1000, min=0)]], initial="diffuse", step=1.0)


def processor():
    return time.process_time()


def raw(y):
    return _identikal.run("tune", [(LEVEL.text, "")], [(None, y, None, 0.0, [], [])], [], [],
                          '{"starts": 1, "no-profiles": true}', None)


def whole(y):
    return ik.tune(LEVEL, y, starts=1, profiles=False, warn=True).params["q"].value


def calls(count):
    pairs = []
    for _ in range(count):
        begin = processor()
        raw(FLOW)
        middle = processor()
        whole(FLOW)
        pairs.append((middle - begin, processor() - middle))
    a, b = (sorted(each) for each in zip(*pairs))
    beside = sorted(y - x for x, y in pairs)[count // 2]
    print(f"a call: raw {1e6 * a[count // 2]:.0f} us, tune {1e6 * b[count // 2]:.0f} us, Python's part {1e6 * beside:.0f} us")


def fits(count):
    of = np.random.default_rng(1)
    series = [FLOW + of.normal(size=100) for _ in range(min(count, 1000))]
    for name, work in (("raw", raw), ("tune", whole), ("raw", raw), ("tune", whole)):
        begin = processor()
        for i in range(count // 2):
            work(series[i % len(series)])
        print(f"{count // 2} fits, {name}: {(processor() - begin) / (count // 2) * 1e6:.1f} us each")


    for number in (1, 2, 1, 2):
        begin, clock = processor(), time.perf_counter()
        for fit in ik.each("tune", LEVEL, (series[i % len(series)] for i in range(count // 2)), threads=number):
            fit.params["q"].value
        print(f"{count // 2} default fits, each() on {number}: {(processor() - begin) / (count // 2) * 1e6:.1f} us of processor each, "
              f"{(time.perf_counter() - clock) / (count // 2) * 1e6:.1f} by the clock")


def beside_cpp(bench, count=500, pairs=40):
    """Default fits by each() and by a loop in C++, in turn: others may use the machine meanwhile, and what slows one of a pair slows both."""
    of = np.random.default_rng(1)
    series = [FLOW + of.normal(size=100) for _ in range(count)]
    with tempfile.NamedTemporaryFile("w", suffix=".yaml") as model:
        model.write(LEVEL.text)
        model.flush()
        ours, theirs = [], []
        for _ in range(pairs):
            out = subprocess.run([bench, model.name, os.path.join(ROOT, "data/nile.csv"), str(count), "loop"], capture_output=True, text=True, check=True)
            theirs.append(float(out.stdout.split()[0]))
            begin = processor()
            for fit in ik.each("tune", LEVEL, series, threads=1):
                fit.params["q"].value
            ours.append((processor() - begin) / count * 1e6)
    rates = [cpp / each for cpp, each in zip(theirs, ours)]
    low, middle, high = statistics.quantiles(rates, n=4)
    print(f"default fits, {pairs} pairs of {count}: C++ {statistics.median(theirs):.0f} us, each() {statistics.median(ours):.0f} us; "
          f"rate of each() over that of C++: median {middle:.3f}, half of the pairs between {low:.3f} and {high:.3f}")


def threads(count):
    def work():
        for _ in range(count):
            whole(FLOW)
    rates = []
    for number in (1, 2, 1, 2):
        workers = [threading.Thread(target=work) for _ in range(number)]
        begin = time.perf_counter()
        for worker in workers:
            worker.start()
        for worker in workers:
            worker.join()
        rates.append(number * count / (time.perf_counter() - begin))
    print(f"threads: 1: {rates[0]:.0f} and {rates[2]:.0f} fits/s, 2: {rates[1]:.0f} and {rates[3]:.0f}, "
          f"{(rates[1] + rates[3]) / (rates[0] + rates[2]):.2f} times")


def resident(what):
    with open("/proc/self/status", encoding="ascii") as file:
        return next(int(line.split()[1]) / 1024 for line in file if line.startswith(what))


def memory():
    y = np.random.default_rng(1).normal(size=10_000_000)
    taken = ik.Recording(y)
    print(f"10^7 rows: {'the same memory' if np.shares_memory(taken.y, y) else 'a copy'} is handed over, ", end="")
    before = resident("VmRSS")
    model = ik.LinearModel(A=0.5, C=1, Q=[[ik.p("q", 1, min=0)]], R=[[ik.p("r", 1, min=0)]], step=1.0)
    begin = processor()
    result = ik.tune(model, y, starts=1, warn=False)
    print(f"peak {resident('VmHWM') - before:.0f} MB above the array's 76, {processor() - begin:.2f} s; ", end="")
    print(f"the result keeps {resident('VmRSS') - before:.0f} MB ({result.status})")


def system7(y):
    """System 7 as a model of statsmodels."""
    from statsmodels.tsa.statespace.mlemodel import MLEModel

    class System(MLEModel):
        start_params = [1.0] * 5
        param_names = ["q1", "q2", "q3", "r1", "r2"]

        def __init__(self):
            super().__init__(y, k_states=4, k_posdef=3, initialization="stationary")
            self["transition"] = np.array([[.9, 0, 1, 1], [0, -.8, 0, -1], [0, -.1, .85, 1], [-.2, 0, 0, -.9]])
            self["selection"] = np.array([[0, 0, .1], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
            self["design"] = np.array([[1.0, 0, 0, 1], [0, 1, 1, 0]])

        def transform_params(self, free):
            return free ** 2

        def untransform_params(self, values):
            return np.sqrt(values)

        def update(self, params, **more):
            params = super().update(params, **more)
            self["state_cov"] = np.diag(params[:3])
            self["obs_cov"] = np.diag(params[3:])
    return System()


def beside_statsmodels():
    from statsmodels.tsa.statespace.structural import UnobservedComponents
    of = np.random.default_rng(4)
    n = 600
    season = np.tile(of.normal(size=12), n // 12)
    cases = [("Nile", FLOW, dict(level="local level"), LEVEL),
             ("trend", np.cumsum(np.cumsum(.1 * of.normal(size=n))) + of.normal(size=n), dict(level="local linear trend"),
              ik.LinearModel(A=[[1, 1], [0, 1]], C=[[1, 0]], Q=[[ik.p("ql", .1, min=0), 0], [0, ik.p("qs", .1, min=0)]],
                             R=[[ik.p("r", .1, min=0)]], initial="diffuse", step=1.0)),
             ("season", season + np.cumsum(of.normal(size=n)) + of.normal(size=n),
              dict(level="local level", seasonal=12),
              ik.Model.from_text("identikal: 1\ntime: {step: 1, kind: discrete}\nparameters: {q: {value: 1, min: 0}, "
                                 "s: {value: .1, min: 0}, r: {value: 1, min: 0}}\ncomponents:\n  level: {kind: level, "
                                 "variance: q}\n  year: {kind: season, period: 12, variance: s}\noutputs: [{name: y}]\n"
                                 "noise: {measurement: {variance: {y: r}}}\n"))]
    seven = ik.Model(os.path.join(ROOT, "examples/system7.yaml"))
    cases.append(("System 7, 10,000 rows", ik.simulate(seven, rows=10000).values[:, :2].copy(), None, seven))
    for name, y, components, model in cases:
        begin = processor()
        ours = ik.tune(model, y, warn=False)
        mine = processor() - begin
        theirs_model = system7(y) if components is None else UnobservedComponents(y, use_exact_diffuse=True, **components)
        begin = processor()
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            theirs = theirs_model.fit(disp=0)
        other = processor() - begin
        values = ", ".join(f"{p.name} {p.value:.5g} +- {p.se:.2g}" for p in ours.params.values())
        peers = ", ".join(f"{k} {v:.5g} +- {s:.2g}" for k, v, s in zip(theirs.param_names, theirs.params, theirs.bse))
        print(f"{name}: identikal {1e3 * mine:.1f} ms, L {ours.log_likelihood:.4f}, {values}\n"
              f"{' ' * len(name)}  statsmodels {1e3 * other:.1f} ms, L {theirs.llf:.4f}, {peers}")


count = int(sys.argv[1]) if len(sys.argv) > 1 else 100_000
warnings.simplefilter("ignore", ik.FindingWarning)
memory()
calls(2000)
threads(3000)
fits(count)
if len(sys.argv) > 2:
    beside_cpp(sys.argv[2])
beside_statsmodels()
