"""What a joint-space metric is: a positive definite W(q) that measures velocities."""

from abc import ABC, abstractmethod
from functools import partial
from typing import Any, ClassVar, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import solve_lower, solve_lower_transposed
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import RobotState

IDENTITY, CONSTANT, VARYING = 0, 1, 2
"""How much work a metric asks for: no solve; solves; solves and terms in W'."""


class MetricSample(NamedTuple):
    """A metric at one state.

    Attributes:
        W: The metric, shape (nv, nv).
        L: Its Cholesky factor, W = L Lᵀ, lower triangular, shape (nv, nv).
        W_dot: Its time derivative along v, shape (nv, nv).
    """

    W: Array
    L: Array
    W_dot: Array

    @classmethod
    def allocate(cls, nv: int) -> "MetricSample":
        """Return the identity metric of nv freedoms."""
        return cls(np.eye(nv), np.eye(nv), np.zeros((nv, nv)))


class Metric(ABC):
    """A joint-space metric W(q): symmetric, positive definite.

    It decides what "the smallest joint motion" is: the pseudo-inverse is
    J# = W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹, the projector P = I - J#J, and a cost's field -W⁻¹∇f.

    To implement one, set `form` to CONSTANT or VARYING and write `evaluate`.
    """

    form: ClassVar[int]

    def check(self, nv: int) -> None:  # noqa: B027 (most metrics fit every robot)
        """Raise MetricError if the metric does not fit a robot of nv freedoms."""

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let an `evaluate` that is overridden count, also of a ready metric."""
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = Metric.compile  # type: ignore[method-assign]

    def compile(self, state: RobotState, out: MetricSample) -> StepPlan:
        """Return what `evaluate` does with this state and this sample."""
        return StepPlan(write=(partial(self.evaluate, state, out),))

    @abstractmethod
    def evaluate(self, state: RobotState, out: MetricSample) -> MetricSample:
        """Write W, L and W' at a state into ``out`` and return it."""


@kernel
def raise_covector(covector: Array, L: Array, form: int) -> None:
    """Overwrite a covector by W⁻¹ covector."""
    if form != IDENTITY:
        solve_lower(L, covector)
        solve_lower_transposed(L, covector)
