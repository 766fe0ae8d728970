"""An extended Kalman filter around functions that cannot be formulas: tables, loops, `if`, other libraries."""

import numpy as np

from ._errors import InputError

# Of a state's size: the cube root of the precision, where rounding and curvature balance.
_STEP = 6e-6


def extended_filter(dynamics, outputs, *, Q, R, mean, covariance):
    """A filter for tune_external: x(k+1) = dynamics(x, theta[, u]) + w, y(k) = outputs(x, theta[, u]) + v, w ~ (0, Q),
    v ~ (0, R). The functions are called at every sample, their Jacobians are central differences; both have to be smooth
    near the states. What FormulaModel can trace runs a hundred times faster there.

    dynamics  gives n numbers, outputs ny numbers (or one)
    Q, R      n x n and ny x ny, numbers for 1 x 1, or functions of theta that give these
    mean, covariance  of the first state, n and n x n, or functions of theta
    data of tune_external: y (rows, or rows x ny; NaN where an output is missing), or (y, u) with a row u[k] per sample

        run = extended_filter(tank, lambda x, theta: np.interp(x[0], heights, volts), Q=lambda theta: theta["q"],
                              R=1e-4, mean=[0.3], covariance=0.01)
        fit = tune_external(run, {"q": 1e-3}, volts, limits={"q": (0, None)})
    """

    def run(theta, data):
        y, u = data if isinstance(data, tuple) else (data, None)
        y = np.asarray(y, dtype=float)
        y = y[:, None] if y.ndim == 1 else y
        given = [(theta,) if u is None else (theta, row) for row in (np.asarray(u) if u is not None else y)]
        q, r, P = (_matrix(each, theta) for each in (Q, R, covariance))
        x = np.atleast_1d(np.asarray(mean(theta) if callable(mean) else mean, dtype=float))
        _check(x, P, q, r, y)
        e, S = np.full(y.shape, np.nan), np.tile(np.eye(y.shape[1]), (len(y), 1, 1))
        for k, now in enumerate(given):
            there = np.isfinite(y[k])
            H = _jacobian(outputs, x, now)
            S[k] = H @ P @ H.T + r
            if there.any():
                H, D = H[there], S[k][np.ix_(there, there)]
                e[k, there] = y[k, there] - _value(outputs, x, now)[there]
                K = np.linalg.solve(D, H @ P).T
                x = x + K @ e[k, there]
                left = np.eye(len(x)) - K @ H
                P = left @ P @ left.T + K @ r[np.ix_(there, there)] @ K.T
            F = _jacobian(dynamics, x, now)
            x = _value(dynamics, x, now)
            P = F @ P @ F.T + q
            if not np.isfinite(x).all():
                return None
        return e, S

    return run


def _matrix(given, theta):
    return np.atleast_2d(np.asarray(given(theta) if callable(given) else given, dtype=float))


def _value(function, x, now):
    return np.atleast_1d(np.asarray(function(x, *now), dtype=float))


def _jacobian(function, x, now):
    columns = []
    for i, size in enumerate(np.maximum(np.abs(x), 1e-3)):
        step = np.zeros(len(x))
        step[i] = _STEP * size
        columns.append((_value(function, x + step, now) - _value(function, x - step, now)) / (2.0 * step[i]))
    return np.stack(columns, axis=1)


def _check(x, P, q, r, y):
    n, ny = len(x), y.shape[1]
    for name, M, size in (("covariance", P, n), ("Q", q, n), ("R", r, ny)):
        if M.shape != (size, size):
            raise InputError(f"{name} is {M.shape[0]} x {M.shape[1]}; expected {size} x {size}")
