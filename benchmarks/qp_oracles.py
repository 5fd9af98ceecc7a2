"""What decides about an answer of the QP solver: quadprog, and rational arithmetic."""

from fractions import Fraction

import numpy as np
import quadprog
from numpy.typing import NDArray
from qp_cases import Answer, Case, in_y, residual

from hsp_control.common.arrays import Array

Rationals = NDArray[np.object_]
"""An array of fractions."""


def by_quadprog(case: Case) -> Array | None:
    """Return x by quadprog, or None. It declares redundant equalities inconsistent."""
    constraints, nz = in_y(case), len(case.JT)
    if constraints is None:
        return None
    C, lower, upper = constraints
    same = upper - lower < 1e-12
    G = np.vstack([C[same], C[~same], -C[~same]])
    b = np.concatenate([lower[same], lower[~same], -upper[~same]])
    some, equal = np.isfinite(b), int(same.sum())
    if not some.any():
        return case.x0
    try:
        y = quadprog.solve_qp(np.eye(nz), np.zeros(nz), G[some].T, b[some], equal)[0]
    except ValueError:
        return None
    return np.asarray(case.x0 + case.JT.T @ y)


def exact_cost(case: Case, found: Answer) -> float | None:
    """Return the cost of the active set's optimum, in rational numbers.

    None if it is not the optimum of the QP: its constraints depend on each other, a
    multiplier has the wrong sign, or it is more than 1e-9 beyond a constraint.
    """
    exact = np.vectorize(Fraction, otypes=[object])
    JT, rows, x0 = exact(case.JT), exact(case.rows), exact(case.x0)
    active = found.active
    B = rows[active] @ JT.T
    bound = np.where(found.sides > 0, case.lower[active], case.upper[active])
    u = _solved(B @ B.T, exact(bound) - rows[active] @ x0) if len(active) else B[:, 0]
    if u is None:
        return None
    y = B.T @ u
    wrong = [
        side * each < 0
        for side, each, i in zip(found.sides, u, active, strict=True)
        if i >= case.equalities
    ]
    x = (x0 + JT.T @ y).astype(float)
    if any(wrong) or residual(case, x) > 1e-9:
        return None
    return float(sum(each * each for each in y) / 2)


def _solved(G: Rationals, b: Rationals) -> Rationals | None:
    """Return G⁻¹ b by Gauss' elimination, None if G is singular."""
    G, b = G.copy(), b.copy()
    n = len(b)
    for i in range(n):
        pivot = next((r for r in range(i, n) if G[r, i] != 0), None)
        if pivot is None:
            return None
        G[[i, pivot]], b[[i, pivot]] = G[[pivot, i]], b[[pivot, i]]
        for r in range(i + 1, n):
            ratio = G[r, i] / G[i, i]
            G[r] -= ratio * G[i]
            b[r] -= ratio * b[i]
    for i in reversed(range(n)):
        b[i] = (b[i] - G[i, i + 1 :] @ b[i + 1 :]) / G[i, i]
    return b
