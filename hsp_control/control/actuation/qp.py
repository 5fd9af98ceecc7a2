"""Quadratic programmes, row by row, and their solver."""

from typing import NamedTuple

import daqp
import numpy as np

from hsp_control.common.arrays import Array

_EQUALITY, _INEQUALITY = 5, 0
_TOLERANCE = 1e-9


class Rows(NamedTuple):
    """Rows lower ≤ A x ≤ upper of a programme.

    Attributes:
        A: Shape (k, n).
        lower: Shape (k,).
        upper: Shape (k,).
    """

    A: Array
    lower: Array
    upper: Array


def solve(H: Array, f: Array, rows: Rows) -> Array | None:
    """Return the x of least ½ xᵀH x + fᵀx with lower ≤ A x ≤ upper; None if none is.

    By DAQP, a dual active-set method (Arnström, Bemporad, Axehill 2022).
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
    """Return rows below each other."""
    some = [each for each in rows if len(each.lower)] or rows[:1]
    return Rows(*(np.concatenate(parts) for parts in zip(*some, strict=True)))
