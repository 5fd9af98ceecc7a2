"""The law's inputs at one state: tasks, a field and a metric."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ShapeError

IDENTITY, CONSTANT, VARYING = 0, 1, 2
"""Form of a metric: W = I (no solves); W' = 0 (solves); any W (solves, terms in W')."""


class TaskSample(NamedTuple):
    """J a + J'v = a_x: the rows of a task at one state.

    Units are given for positions and orientations; other tasks have their own.

    Attributes:
        jacobian: Task Jacobian J, shape (m, nv).
        jacobian_dot: Its time derivative J', shape (m, nv).
        error: e, reference minus actual, in the error coordinates of the task, shape
            (m,) [m or rad].
        error_rate: e', shape (m,) [m/s or rad/s].
        acceleration: Desired acceleration a_x, with which
            e'' + Kv e' + Kp e + offset = 0, in the frame of J's rows, shape (m,)
            [m/s² or rad/s²].
    """

    jacobian: Array
    jacobian_dot: Array
    error: Array
    error_rate: Array
    acceleration: Array

    @classmethod
    def allocate(cls, rows: int, nv: int) -> "TaskSample":
        """Return a sample of zeros with m = ``rows``."""
        return cls(
            np.zeros((rows, nv)),
            np.zeros((rows, nv)),
            np.zeros(rows),
            np.zeros(rows),
            np.zeros(rows),
        )

    def rows(self, start: int, stop: int) -> "TaskSample":
        """Return the rows from ``start`` to ``stop`` - 1, as views of this memory."""
        return TaskSample(*(array[start:stop] for array in self))


class FieldSample(NamedTuple):
    """g and g' = ∂g/∂q·v + ∂g/∂t: a field at one state.

    Attributes:
        g: The field, a desired joint velocity, shape (nv,) [rad/s, m/s].
        g_dot: g', its total time derivative, shape (nv,) [rad/s², m/s²].
    """

    g: Array
    g_dot: Array

    @classmethod
    def allocate(cls, nv: int) -> "FieldSample":
        """Return a sample of zeros, shapes (nv,)."""
        return cls(np.zeros(nv), np.zeros(nv))


class MetricSample(NamedTuple):
    """W = L Lᵀ and W': a metric at one state.

    Attributes:
        W: The metric, symmetric positive definite, shape (nv, nv).
        L: Its Cholesky factor, lower triangular, shape (nv, nv).
        W_dot: W', its time derivative along v, shape (nv, nv) [unit of W per s].
    """

    W: Array
    L: Array
    W_dot: Array

    @classmethod
    def allocate(cls, nv: int) -> "MetricSample":
        """Return the identity metric of nv degrees of freedom, with W' = 0."""
        return cls(np.eye(nv), np.eye(nv), np.zeros((nv, nv)))


def check_sample(
    name: str, given: object, kind: type[FieldSample] | type[MetricSample], nv: int
) -> None:
    """Raise unless an argument is a sample of nv degrees of freedom.

    Raises:
        ShapeError: If it is of another kind or size.
    """
    what = type(given).__name__
    if isinstance(given, kind):
        if len(given[0]) == nv:
            return
        what = f"a {what} of {len(given[0])}"
    raise ShapeError(f"{name} is {what}; needs {kind.__name__}.allocate({nv})")
