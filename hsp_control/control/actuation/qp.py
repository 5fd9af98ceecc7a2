"""Quadratic programs (QPs): their constraint rows and their solver."""

from typing import NamedTuple

import daqp
import numpy as np

from hsp_control.common.arrays import Array

_EQUALITY, _INEQUALITY = 5, 0
_TOLERANCE = 1e-9


class Rows(NamedTuple):
    """Rows lower ≤ A x ≤ upper of a QP.

    Attributes:
        A: Shape (k, n).
        lower: Shape (k,).
        upper: Shape (k,).
    """

    A: Array
    lower: Array
    upper: Array


def solve(H: Array, f: Array, rows: Rows) -> Array | None:
    """Minimise ½ xᵀH x + fᵀx subject to lower ≤ A x ≤ upper.

    Solved by DAQP, a dual active-set method (Arnström, Bemporad, Axehill 2022).

    Args:
        H: Positive definite, shape (n, n).
        f: Shape (n,).
        rows: The constraints; those with lower = upper are equalities.

    Returns:
        x, shape (n,), or None if the solver finds none.
    """
    lower, upper = rows.lower, rows.upper
    sense = np.where(upper - lower < 1e-12, _EQUALITY, _INEQUALITY).astype(np.int32)
    x, _, flag, _ = daqp.solve(
        np.ascontiguousarray(H),
        np.ascontiguousarray(f),
        np.ascontiguousarray(rows.A),
        upper,
        lower,
        sense,
        primal_tol=_TOLERANCE,
    )
    if flag < 1 or not np.isfinite(x).all():
        return None
    return np.asarray(x)


def stacked(*rows: Rows) -> Rows:
    """Return all rows stacked in one `Rows`; empty ones are left out."""
    some = [each for each in rows if len(each.lower)] or rows[:1]
    return Rows(*(np.concatenate(parts) for parts in zip(*some, strict=True)))
