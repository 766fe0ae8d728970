"""Random models, samples and options for the package of Python: every call answers, or raises InputError.

python_calls.py CALLS [SEED], with the package on PYTHONPATH; tests/install/python_sanitized.py does it under sanitizers.
"""
import sys

import numpy as np

import identikal as ik


def random_object(of, depth=0):
    simple = [None, True, 0, -1, 3.5, float("nan"), float("inf"), "", "y", "diffuse", b"x", 1j, object(), np.float32(2), [], {}]
    kind = of.integers(8)
    if kind < 3 or depth > 2:
        return simple[of.integers(len(simple))]
    if kind == 3:
        return of.normal(size=tuple(of.integers(0, 4, size=of.integers(0, 4))))
    if kind == 4:
        return [random_object(of, depth + 1) for _ in range(of.integers(4))]
    if kind == 5:
        return {str(random_object(of, depth + 1))[:9]: random_object(of, depth + 1) for _ in range(of.integers(3))}
    if kind == 6:
        return of.normal(size=(of.integers(1, 30), of.integers(1, 3)))
    return np.zeros(of.integers(5), dtype=of.choice(["f4", "i8", "M8[s]", "U3", "O"]))


def first_of_each(model, data, warn, **options):
    """On threads of their own; an empty list of recordings has no first one."""
    given = data if isinstance(data, list) else [data, data, None]
    results = list(ik.each("tune", model, given, threads=2, **options))
    if not results:
        raise ik.InputError("no recording")
    return results[0]


def random_call(of):
    verbs = [ik.tune, ik.check, ik.filter, ik.smooth, ik.bound, ik.simulate, ik.shape, ik.track, ik.validate, ik.forecast, ik.fit, first_of_each]
    keys = ["A", "C", "Q", "R", "G", "B", "S", "initial", "step", "outputs", "inputs", "continuous", "parameters"]
    given = {"A": 0.9, "C": 1, "step": 1.0}
    for _ in range(of.integers(3)):
        given[keys[of.integers(len(keys))]] = random_object(of)
    options = {}
    for _ in range(of.integers(3)):
        options[["starts", "seed", "u", "time", "step", "hold_out", "method", "rows", "lags", "set", "smooth"][of.integers(11)]] = \
            random_object(of)
    data = of.normal(size=of.integers(1, 60)) if of.integers(2) else random_object(of)
    model = ik.LinearModel(**given)
    return verbs[of.integers(len(verbs))](model, data, warn=False, **options)


def answered(calls, seed):
    """How many calls gave a result; what they raise beside InputError is raised."""
    of, count = np.random.default_rng(seed), 0
    for _ in range(calls):
        try:
            count += random_call(of).code in (0, 1, 3)
        except ik.InputError:
            pass
    return count


if __name__ == "__main__":
    wanted = int(sys.argv[1])
    print(wanted, "calls,", answered(wanted, int(sys.argv[2]) if len(sys.argv) > 2 else 1), "answered, none broke a promise")
