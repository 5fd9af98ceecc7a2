"""Directional manipulability: keep the frame quick, or strong, along one direction."""

from collections.abc import Sequence
from typing import Literal

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.jacobian_cost import JacobianCost, JacobianTerms
from hsp_control.fields.manipulability import FLOOR
from hsp_control.robot import Robot


class Transmission(JacobianCost):
    """f = -(uᵀG⁻¹u)^(-1/2) for velocity, -(uᵀGu)^(-1/2) for force, G = J Jᵀ.

    The transmission ratio along the world direction u, the ellipsoid's radius there
    (Chiu 1988): how fast the frame moves, or how hard it pushes, for unit joint rates
    or efforts.
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
            direction: u in the world, one number for each of the axes in the order that
                they are named in; normalised here.
            kind: ``velocity`` or ``force``.
            axes: World axes of the position rows.
            name: What the log calls it.

        Raises:
            FieldError: If the direction or the kind is none.
            FrameNotFoundError: If the robot has no such frame.
        """
        super().__init__(robot, frame, rows="position", axes=axes, name=name)
        u = np.asarray(direction, dtype=float)
        if u.shape != (len(axes),) or not 0.0 < np.linalg.norm(u) < np.inf:
            raise FieldError(
                f"field {name!r}: direction {list(direction)} needs {len(axes)} "
                "numbers, not all zero"
            )
        if kind not in ("velocity", "force"):
            raise FieldError(f"field {name!r}: kind {kind!r}; choose velocity or force")
        self.kind = kind
        self.direction: Array = u[np.argsort(list(axes))] / np.linalg.norm(u)

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        """Return f, its slope and rate; both kinds are a power of one square s."""
        u = self.direction
        if self.kind == "force":
            # s = uᵀGu, ∂s/∂J = 2 u (Jᵀu)ᵀ
            y, y_dot, sign = u, np.zeros_like(u), 1.0
        else:
            # s = uᵀG⁻¹u, ∂s/∂J = -2 y (Jᵀy)ᵀ with y = G⁻¹u
            G = J @ J.T + FLOOR**2 * np.eye(len(J))
            G_dot = J_dot @ J.T
            G_dot += G_dot.T
            y = np.asarray(np.linalg.solve(G, u))
            y_dot = np.asarray(-np.linalg.solve(G, G_dot @ y))
            sign = -1.0
        z, z_dot = J.T @ y, J_dot.T @ y + J.T @ y_dot
        s = float(u @ y) if sign < 0.0 else float(z @ z) + FLOOR**2
        slope = 2.0 * sign * np.outer(y, z)
        slope_rate = 2.0 * sign * (np.outer(y_dot, z) + np.outer(y, z_dot))
        s_dot = float(np.vdot(slope, J_dot))
        # f = -s^(-1/2), ∂f/∂s = ½ s^(-3/2)
        outer, outer_dot = 0.5 * s**-1.5, -0.75 * s**-2.5 * s_dot
        return JacobianTerms(
            -(s**-0.5), outer * slope, outer_dot * slope + outer * slope_rate
        )
