"""Directional manipulability: velocity or force of a frame along one direction."""

from collections.abc import Callable
from dataclasses import KW_ONLY
from math import sqrt
from typing import Any, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    cholesky,
    gram,
    multiply,
    multiply_transposed,
    solve_lower,
    solve_lower_transposed,
)
from hsp_control.declaration.quantities import Vector
from hsp_control.null_space.fields.jacobian_cost import CompiledJacobianCost
from hsp_control.null_space.fields.manipulability import FLOOR


class Transmission(CompiledJacobianCost, type="transmission"):
    """f = -(uᵀG⁻¹u)^(-1/2) for velocity, -(uᵀGu)^(-1/2) for force, G = J Jᵀ.

    -f is the transmission ratio along the world direction u, the radius of the
    manipulability ellipsoid in that direction (Chiu 1988): the velocity or force of the
    frame for joint velocities or efforts of norm 1.
    """

    _: KW_ONLY
    direction: Vector
    """The direction, of any length but zero [-]: one number for each letter of
    ``axes``, in the same order."""
    kind: Literal["velocity", "force"] = "velocity"
    """Transmission of velocity (fast motion) or of force (large force) [-]."""

    def __post_init__(self) -> None:
        """Check the direction."""
        given = np.asarray(self.direction)
        with np.errstate(over="ignore"):
            length = np.linalg.norm(given)
        if len(given) != len(self.axes) or not 0.0 < length < np.inf:
            raise FieldError(
                f"direction {given.tolist()} needs {len(self.axes)} numbers, one for "
                f"each of the axes {self.axes!r}, of a length that is not 0 or infinite"
            )

    @property
    def unit_direction(self) -> Array:
        """u, the direction of length 1 in the order x, y, z, shape (k,)."""
        given = np.asarray(self.direction)
        unit: Array = given[np.argsort(list(self.axes))] / np.linalg.norm(given)
        return unit

    def _kernel(self, nv: int) -> tuple[Callable[..., float], tuple[Any, ...]]:
        return _transmission, (self.unit_direction, self.kind == "force", FLOOR**2)


@kernel
def _transmission(
    u: Array,
    force: bool,
    floor: float,
    J: Array,
    J_dot: Array,
    slope: Array,
    slope_rate: Array,
    scratch: Array,
) -> float:
    """Write ∂f/∂J and its rate, and return f = -s^(-1/2).

    Force: s = uᵀGu, ∂s/∂J = 2 u (Jᵀu)ᵀ. Velocity: s = uᵀG⁻¹u, ∂s/∂J = -2 y (Jᵀy)ᵀ with
    y = G⁻¹u. Both are ±2 y zᵀ with z = Jᵀy, where y = u for force.
    """
    k, n = J.shape
    y, y_dot, z, z_dot, term = (
        scratch[0, 0, :k],
        scratch[1, 0, :k],
        scratch[2, 0],
        scratch[3, 0],
        scratch[4, 0],
    )
    for i in range(k):
        y[i], y_dot[i] = u[i], 0.0
    if not force:
        G, G_dot, L = scratch[5, :, :k], scratch[6, :, :k], scratch[7, :, :k]
        gram(J, J, False, G)
        gram(J_dot, J, True, G_dot)
        for i in range(k):
            G[i, i] += floor
        cholesky(G, L)
        solve_lower(L, y)
        solve_lower_transposed(L, y)
        multiply(G_dot, y, y_dot)
        solve_lower(L, y_dot)
        solve_lower_transposed(L, y_dot)
        for i in range(k):
            y_dot[i] = -y_dot[i]
    multiply_transposed(J, y, z)
    multiply_transposed(J, y_dot, z_dot)
    multiply_transposed(J_dot, y, term)
    s = floor if force else 0.0
    for j in range(n):
        z_dot[j] += term[j]
        if force:
            s += z[j] * z[j]
    if not force:
        for i in range(k):
            s += u[i] * y[i]
    double = 2.0 if force else -2.0
    s_dot = 0.0
    for i in range(k):
        for j in range(n):
            s_dot += double * y[i] * z[j] * J_dot[i, j]
    # f = -s^(-1/2), ∂f/∂s = ½ s^(-3/2)
    outer = 0.5 / (s * sqrt(s))
    outer_dot = -1.5 * outer / s * s_dot
    for i in range(k):
        for j in range(n):
            change = double * y[i] * z[j]
            change_dot = double * (y_dot[i] * z[j] + y[i] * z_dot[j])
            slope[i, j] = outer * change
            slope_rate[i, j] = outer_dot * change + outer * change_dot
    return -1.0 / sqrt(s)
