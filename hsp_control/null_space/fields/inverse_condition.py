"""The inverse condition number of a frame's Jacobian, a cost for isotropic motion."""

from collections.abc import Callable
from dataclasses import KW_ONLY
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import cholesky, gram, solve_columns
from hsp_control.declaration.quantities import Positive
from hsp_control.null_space.fields.jacobian_cost import CompiledJacobianCost, Rows
from hsp_control.null_space.fields.manipulability import FLOOR


class InverseCondition(CompiledJacobianCost, type="inverse_condition"):
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

    def _kernel(self, nv: int) -> tuple[Callable[..., float], tuple[Any, ...]]:
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
