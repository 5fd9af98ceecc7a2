"""Measures of the Jacobian: manipulability and condition."""

from dataclasses import KW_ONLY
from math import exp, log
from typing import Literal, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import (
    cholesky,
    gram,
    multiply_transposed,
    solve_columns,
)
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Matrix, Positive
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields.jacobian_cost import JacobianCost, Rows

FLOOR = 1e-6
"""Its square is added to the squared singular values, so that all slopes are finite."""


class Manipulability(JacobianCost, type="manipulability"):
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

    def terms_kernel(self, nv: int) -> KernelCall:
        """Return the kernel; see `JacobianCost.terms_kernel`."""
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
    _solve_with_rate(L, G_dot, JW, JW_dot, slope, slope_rate)
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


class InverseCondition(JacobianCost, type="inverse_condition"):
    """f = -k²/(tr G · tr G⁻¹), G = J Jᵀ of k rows.

    -f is the square of the inverse condition number in the Frobenius norm: 1 where all
    singular values are equal, 0 at a singularity. It is smooth everywhere, whereas
    σ_min/σ_max is not smooth where two singular values are equal.
    """

    _: KW_ONLY
    rows: Rows = "position"
    """Rows of the Jacobian [-]."""
    length: Positive = 1.0
    """Length that is equivalent to one radian [m], for rows of metres and radians."""

    def terms_kernel(self, nv: int) -> KernelCall:
        """Return the kernel; see `JacobianCost.terms_kernel`."""
        return _inverse_condition, (FLOOR**2,)


@kernel
def _inverse_condition(
    floor: float,
    J: Array,
    J_dot: Array,
    slope: Array,
    slope_rate: Array,
    scratch: Array,
) -> float:
    """Write ∂f/∂J = 2φ(J/tr G - G⁻²J/tr G⁻¹) with φ = -f, and its rate; return f.

    Y = G⁻¹J and Z = G⁻¹Y = G⁻²J, hence Y' = G⁻¹(J' - G'Y) and Z' = G⁻¹(Y' - G'Z).
    """
    k, n = J.shape
    Y, Y_dot, Z, Z_dot = scratch[0], scratch[1], scratch[2], scratch[3]
    G, G_dot, L, G_inv = (
        scratch[4, :, :k],
        scratch[5, :, :k],
        scratch[6, :, :k],
        scratch[7, :, :k],
    )
    gram(J, J, False, G)
    gram(J_dot, J, True, G_dot)
    for i in range(k):
        G[i, i] += floor
        for j in range(k):
            G_inv[i, j] = 1.0 if i == j else 0.0
    cholesky(G, L)
    solve_columns(L, G_inv)
    size = size_dot = stretch = stretch_dot = 0.0
    for i in range(k):
        size += G[i, i]
        size_dot += G_dot[i, i]
        stretch += G_inv[i, i]
        for j in range(k):
            for p in range(k):  # -tr(G⁻¹G'G⁻¹)
                stretch_dot -= G_inv[p, i] * G_dot[i, j] * G_inv[j, p]
    _solve_with_rate(L, G_dot, J, J_dot, Y, Y_dot)
    _solve_with_rate(L, G_dot, Y, Y_dot, Z, Z_dot)
    phi = k * k / (size * stretch)
    phi_dot = -phi * (size_dot / size + stretch_dot / stretch)
    for i in range(k):
        for j in range(n):
            inner = J[i, j] / size - Z[i, j] / stretch
            inner_dot = (
                J_dot[i, j] / size
                - J[i, j] * size_dot / (size * size)
                - Z_dot[i, j] / stretch
                + Z[i, j] * stretch_dot / (stretch * stretch)
            )
            slope[i, j] = 2.0 * phi * inner
            slope_rate[i, j] = 2.0 * (phi_dot * inner + phi * inner_dot)
    return float(-phi)


@kernel
def _solve_with_rate(
    L: Array, G_dot: Array, X: Array, X_dot: Array, Y: Array, Y_dot: Array
) -> None:
    """Write Y = G⁻¹X and Y' = G⁻¹(X' - G'Y) with G = L Lᵀ."""
    k, n = X.shape
    for i in range(k):
        for j in range(n):
            Y[i, j] = X[i, j]
    solve_columns(L, Y)
    for i in range(k):
        for j in range(n):
            Y_dot[i, j] = X_dot[i, j]
            for p in range(k):
                Y_dot[i, j] -= G_dot[i, p] * Y[p, j]
    solve_columns(L, Y_dot)
