"""Robots that the law is tested on, and the pseudo-inverse by itself."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.compiled.linalg import bounded_inverse
from hsp_control.law import CONSTANT, IDENTITY
from hsp_control.law.pseudo_inverse import whiten


def pseudo_inverse(J: Array, W: Array | None, threshold: float) -> tuple[Array, bool]:
    """Return the package's J# and whether it was damped; W None: the identity."""
    m, n = J.shape
    form, L = (IDENTITY, np.eye(n)) if W is None else (CONSTANT, np.linalg.cholesky(W))
    B, Q, X = (np.full(shape, np.nan) for shape in ((m, n), (m, n), (m, m)))
    whiten(J, L, form, B)
    damped = bounded_inverse(B, threshold, Q, X)
    return np.linalg.solve(L.T, Q.T @ X), damped


@cache
def load(name: str) -> Robot:
    if name == "panda_fingers":
        return Robot.load("panda", locked={})
    if name not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    return Robot.load(name)
