"""Yoshikawa's manipulability of a frame, as a cost."""

from collections.abc import Callable
from dataclasses import KW_ONLY
from math import exp, log
from typing import Any, Literal, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import cholesky, gram, multiply_transposed, solve_columns
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Matrix, Positive
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.jacobian_cost import CompiledJacobianCost, Rows

FLOOR = 1e-6
"""Its square is added to the squared singular values, so that all slopes are finite."""


class Manipulability(CompiledJacobianCost, type="manipulability"):
    """f = -det(G), -√det(G) or -½ log det(G), with G = J W⁻¹ Jᵀ of a frame's rows.

    Yoshikawa (1985) maximises √det(J Jᵀ). Towards a singularity the slope of the
    logarithm grows, and the slope of the determinant vanishes. W is a constant metric.
    """

    _: KW_ONLY
    form: Literal["determinant", "root", "log"] = "root"
    """Function of det(G) [-]: the determinant itself, its square root, or its
    logarithm."""
    rows: Rows = "position"
    """Rows of the Jacobian [-]."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""
    metric: Matrix | None = None
    """W, symmetric and positive definite, shape (nv, nv) [-]; the identity by
    default."""

    def __post_init__(self) -> None:
        """Check the metric."""
        if self.metric is None:
            return
        W = np.asarray(self.metric)
        if W.shape[0] != W.shape[1] or not np.allclose(W, W.T):
            raise FieldError(f"metric has shape {W.shape}; needs (nv, nv), symmetric")
        if np.linalg.eigvalsh(W)[0] <= 0.0:
            raise FieldError("metric is not positive definite")

    def placed(self, start: Start) -> Self:
        """Return the cost with the name of its frame; see `JacobianCost.placed`."""
        nv = start.state.robot.nv
        if self.metric is not None and len(np.asarray(self.metric)) != nv:
            with within("metric"):
                shape = np.shape(self.metric)
                raise FieldError(f"metric has shape {shape}; needs ({nv}, {nv})")
        return super().placed(start)

    def _kernel(self, nv: int) -> tuple[Callable[..., float], tuple[Any, ...]]:
        weighted = self.metric is not None
        W_inv = np.linalg.inv(np.array(self.metric)) if weighted else np.eye(nv)
        # Larger if the entries of W are small: it must exceed the rounding error of G.
        floor = FLOOR**2 * max(1.0, 0.1 * float(np.trace(W_inv)) / nv)
        power = {"log": 0, "root": 1, "determinant": 2}[self.form]
        return _manipulability, (np.asarray(W_inv), weighted, floor, power)


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
