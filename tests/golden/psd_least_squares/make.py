"""Makes problems.txt: conic least-squares problems from a seed, solved by CVXOPT in well scaled units.

python3 make.py > problems.txt    (Debian: python3-cvxopt python3-numpy)

Every line is one problem, fields separated by spaces:
name k, optimum, width (the duality gap of CVXOPT's answer, checked here), number of blocks, their sizes
(the unknowns of a block are its lower triangle, column by column, block after block), lower triangle of
H row by row, g.
"""
import sys

import cvxopt
import numpy as np
from cvxopt import solvers

SEED, COUNT = 20061, 50
solvers.options.update(show_progress=False, abstol=1e-13, reltol=1e-13, feastol=1e-13, maxiters=200)


def basis(sizes):
    """Block index, row, column of every unknown."""
    return [(b, i, j) for b, m in enumerate(sizes) for j in range(m) for i in range(j, m)]


def solve(H, g, sizes):
    """Optimum and a bound on its error: x feasible from above, a dual point from below."""
    k, where = len(g), basis(sizes)
    G = [np.zeros((m * m, k)) for m in sizes]
    for u, (b, i, j) in enumerate(where):
        G[b][i + j * sizes[b], u] = G[b][j + i * sizes[b], u] = -1.0
    answer = solvers.coneqp(cvxopt.matrix(H), cvxopt.matrix(-g), cvxopt.matrix(np.vstack(G)),
                            cvxopt.matrix(0.0, (sum(m * m for m in sizes), 1)), {"l": 0, "q": [], "s": sizes})
    x = np.array(answer["x"]).ravel()
    z = np.array(answer["z"]).ravel()
    slope, at = np.zeros(k), 0
    for b, m in enumerate(sizes):
        Z = z[at:at + m * m].reshape(m, m, order="F")
        Z = np.tril(Z) + np.tril(Z, -1).T
        values, vectors = np.linalg.eigh(Z)
        Z = vectors @ np.diag(np.maximum(values, 0.0)) @ vectors.T
        slope -= G[b].T @ Z.ravel()
        at += m * m
    # Into the cone: the interior solver may leave it by its tolerance.
    lowest = 0.0
    for b, m in enumerate(sizes):
        lowest = min(lowest, np.linalg.eigvalsh((-G[b] @ x).reshape(m, m))[0])
    x = x + np.array([-lowest if i == j else 0.0 for _, i, j in where])
    upper = 0.5 * x @ H @ x - g @ x
    values, vectors = np.linalg.eigh(H)
    c = vectors.T @ (g + slope)
    flat = values < 1e-13 * values[-1]
    if np.abs(c[flat]).max(initial=0.0) > 1e-7 * np.abs(g).max():
        return upper, np.inf
    return upper, upper + 0.5 * np.sum(c[~flat] ** 2 / values[~flat])


rng = np.random.default_rng(SEED)
kinds = ["plain", "outside", "deficient", "weak", "units", "units_outside", "trace", "joint", "units_deficient"]
written = 0
trial = 0
while written < COUNT:
    kind = kinds[written % len(kinds)]
    trial += 1
    n, r = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    if kind == "joint":
        sizes = [min(n, 2) + min(r, 2)]
    else:
        sizes = ([n] if rng.random() < 0.6 else [1] * n) + ([r] if rng.random() < 0.6 else [1] * r)
    where = basis(sizes)
    k = len(where)
    if not 2 <= k <= 12:
        continue
    rows = k - 1 - int(rng.integers(0, 2)) if "deficient" in kind else k + int(rng.integers(0, 5))
    if rows < 1:
        continue
    A = rng.standard_normal((rows, k))
    if kind == "weak":  # condition of H: 1e12
        u, s, v = np.linalg.svd(A, full_matrices=False)
        A = u @ np.diag(np.logspace(0, -6, k)) @ v
    # A positive definite truth and noise; "outside" pushes the unconstrained optimum far out of the cone.
    truth = np.zeros(k)
    for b, m in enumerate(sizes):
        M = rng.standard_normal((m, m))
        M = M @ M.T + 0.1 * np.eye(m)
        for u, (block, i, j) in enumerate(where):
            if block == b:
                truth[u] = M[i, j]
    if "outside" in kind:
        b_vector = A @ truth + 30.0 * rng.standard_normal(rows)
    else:
        b_vector = A @ truth + rng.uniform(0.0, 3.0) * rng.standard_normal(rows)
    H, g = A.T @ A, A.T @ b_vector
    if kind == "trace":
        g = g - 0.5 * np.abs(g).max() * np.array([1.0 if i == j else 0.0 for _, i, j in where])
    optimum, width = solve(H, g, sizes)
    if not width < 1e-8 * abs(optimum):
        continue
    # Units, exact because powers of two: X = diag(unit) X' diag(unit), 1e-6 to 1e6 side by side.
    unit = np.ones(k)
    if "units" in kind:
        scale = [2.0 ** rng.integers(-10, 11, m) for m in sizes]
        unit = np.array([scale[b][i] * scale[b][j] for b, i, j in where])
    H, g = H / np.outer(unit, unit), g / unit
    numbers = [repr(float(H[i, j])) for i in range(k) for j in range(i + 1)] + [repr(float(v)) for v in g]
    print(f"{kind} {k} {float(optimum)!r} {float(width):.2g} {len(sizes)}", *sizes, *numbers)
    written += 1
print(f"{trial} drawn, {written} written", file=sys.stderr)
