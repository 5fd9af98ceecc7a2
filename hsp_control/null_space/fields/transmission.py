"""Directional manipulability: velocity or force of a frame along one direction."""

from collections.abc import Callable, Sequence
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
from hsp_control.null_space.fields.jacobian_cost import CompiledJacobianCost
from hsp_control.null_space.fields.manipulability import FLOOR
from hsp_control.robot import Robot


class Transmission(CompiledJacobianCost):
    """f = -(uᵀG⁻¹u)^(-1/2) for velocity, -(uᵀGu)^(-1/2) for force, G = J Jᵀ.

    -f is the transmission ratio along the world direction u, the radius of the
    manipulability ellipsoid in that direction (Chiu 1988): the velocity or force of the
    frame for joint velocities or efforts of norm 1.

    Attributes:
        kind: ``velocity`` or ``force``.
        direction: u of length 1, one number per axis in the order x, y, z.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        direction: Sequence[float],
        *,
        kind: Literal["velocity", "force"] = "velocity",
        axes: str = "xyz",
        name: str = "transmission",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            frame: Name of the frame.
            direction: u in world axes, of any length but zero, one number per letter of
                ``axes``, in the same order.
            kind: ``velocity`` or ``force``.
            axes: World axes of the position rows.
            name: Name of the field in the log.

        Raises:
            FieldError: If the direction has another size, is zero or not finite, the
                kind is unknown, or an argument does not fit; see `JacobianCost`.
            FrameNotFoundError: If the robot has no such frame.
        """
        super().__init__(robot, frame, rows="position", axes=axes, name=name)
        u = np.asarray(direction, dtype=float)
        if u.shape != (len(axes),) or not 0.0 < np.linalg.norm(u) < np.inf:
            raise FieldError(
                f"field {name!r}: direction {list(direction)} needs {len(axes)} "
                "finite numbers, not all zero"
            )
        if kind not in ("velocity", "force"):
            raise FieldError(f"field {name!r}: kind {kind!r}; choose velocity or force")
        self.kind = kind
        self.direction: Array = u[np.argsort(list(axes))] / np.linalg.norm(u)

    def _kernel(self) -> tuple[Callable[..., float], tuple[Any, ...]]:
        return _transmission, (self.direction, self.kind == "force", FLOOR**2)


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
