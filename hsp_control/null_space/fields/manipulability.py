"""Yoshikawa's manipulability of a frame, as a cost."""

from collections.abc import Callable
from math import exp, log
from typing import Any, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import cholesky, gram, multiply_transposed, solve_columns
from hsp_control.null_space.fields.jacobian_cost import CompiledJacobianCost, Rows
from hsp_control.robot import Robot

Form = Literal["determinant", "root", "log"]

FLOOR = 1e-6
"""Its square is added to the squared singular values, so that all slopes are finite."""


class Manipulability(CompiledJacobianCost):
    """f = -det(G), -√det(G) or -½ log det(G), with G = J W⁻¹ Jᵀ of a frame's rows.

    Yoshikawa (1985) maximises √det(J Jᵀ). Towards a singularity the slope of the
    logarithm grows, and the slope of the determinant vanishes. W is a constant metric.

    Attributes:
        form: ``determinant``, ``root`` or ``log``.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        *,
        form: Form = "root",
        rows: Rows = "position",
        axes: str = "xyz",
        length: float = 1.0,
        metric: Any = None,
        name: str = "manipulability",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            frame: Name of the frame.
            form: ``determinant``, ``root`` or ``log``.
            rows: ``position``, ``orientation`` or ``pose``.
            axes: World axes of the position rows.
            length: Characteristic length [m/rad] that scales the orientation rows of a
                ``pose``.
            metric: A constant metric W, shape (nv, nv); None: the identity.
            name: Name of the field in the log.

        Raises:
            FieldError: If the form is unknown, W is not symmetric and positive
                definite, or an argument does not fit; see `JacobianCost`.
            FrameNotFoundError: If the robot has no such frame.
        """
        super().__init__(robot, frame, rows=rows, axes=axes, length=length, name=name)
        if form not in ("determinant", "root", "log"):
            raise FieldError(
                f"field {name!r}: form {form!r}; choose determinant, root or log"
            )
        self.form = form
        self._weighted = metric is not None
        self._W_inv = _inverse(metric, robot.nv) if self._weighted else np.eye(robot.nv)
        # Larger if the entries of W are small: it must exceed the rounding error of G.
        self._floor = FLOOR**2 * max(1.0, 0.1 * float(np.trace(self._W_inv)) / robot.nv)

    def _kernel(self) -> tuple[Callable[..., float], tuple[Any, ...]]:
        power = {"log": 0, "root": 1, "determinant": 2}[self.form]
        return _manipulability, (self._W_inv, self._weighted, self._floor, power)


@kernel
def _manipulability(
    W_inv: Array,
    weighted: bool,
    floor: float,
    power: int,
    J: Array,
    J_dot: Array,
    slope: Array,
    slope_rate: Array,
    scratch: Array,
) -> float:
    """Write ∂f/∂J and its rate, and return f; for φ = ½ log det G ∂φ/∂J is G⁻¹JW⁻¹."""
    k, n = J.shape
    JW, JW_dot, G, G_dot = J, J_dot, scratch[2, :, :k], scratch[3, :, :k]
    if weighted:
        JW, JW_dot = scratch[0], scratch[1]
        for i in range(k):
            multiply_transposed(W_inv, J[i], JW[i])
            multiply_transposed(W_inv, J_dot[i], JW_dot[i])
    gram(JW, J, False, G)
    gram(JW_dot, J, True, G_dot)
    for i in range(k):
        G[i, i] += floor
    L = scratch[4, :, :k]
    cholesky(G, L)
    half_log = 0.0
    for i in range(k):
        half_log += log(L[i, i])
        for j in range(n):
            slope[i, j] = JW[i, j]
    solve_columns(L, slope)
    for i in range(k):
        for j in range(n):
            slope_rate[i, j] = JW_dot[i, j]
            for p in range(k):
                slope_rate[i, j] -= G_dot[i, p] * slope[p, j]
    solve_columns(L, slope_rate)
    # f = -φ, or f = -exp(power φ) with ∂f = power f ∂φ and f' = power f φ'
    value, outer, outer_rate = -half_log, -1.0, 0.0
    if power > 0:
        value = -exp(power * half_log)
        rate = 0.0
        for i in range(k):
            for j in range(n):
                rate += slope[i, j] * J_dot[i, j]
        outer = power * value
        outer_rate = power * outer * rate
    for i in range(k):
        for j in range(n):
            slope_rate[i, j] = outer * slope_rate[i, j] + outer_rate * slope[i, j]
            slope[i, j] *= outer
    return value


def _inverse(metric: Any, nv: int) -> Array:
    W = np.asarray(metric, dtype=float)
    if W.shape != (nv, nv) or not np.allclose(W, W.T):
        raise FieldError(f"metric has shape {W.shape}; needs ({nv}, {nv}), symmetric")
    if np.linalg.eigvalsh(W)[0] <= 0.0:
        raise FieldError("metric is not positive definite")
    return np.asarray(np.linalg.inv(W))
