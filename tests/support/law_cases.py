"""Robots for tests of the law, and the pseudo-inverse alone."""

from functools import cache, partial

import numpy as np
import pytest

from hsp_control import Robot, engine
from hsp_control.common.arrays import Array
from hsp_control.law import CONSTANT, IDENTITY


def pseudo_inverse(J: Array, W: Array | None, threshold: float) -> tuple[Array, bool]:
    """Return the package's J# and whether it was damped; W None: the identity."""
    m, n = J.shape
    form, L = (IDENTITY, np.eye(n)) if W is None else (CONSTANT, np.linalg.cholesky(W))
    columns = np.zeros((m, n))
    inverse = partial(
        engine.SmallestMotion,
        J=np.ascontiguousarray(J),
        L=L,
        form=form,
        threshold=threshold,
    )
    damped = [
        inverse(x=unit, motion=column)()
        for unit, column in zip(np.eye(m), columns, strict=True)
    ]
    return columns.T, any(damped)


@cache
def load(name: str) -> Robot:
    if name == "panda_fingers":
        return Robot.load("panda", locked={})
    if name not in {"planar3r", "panda"}:
        pytest.importorskip("example_robot_data")
    return Robot.load(name)
