"""Yoshikawa's manipulability: keep the frame able to move every way."""

from typing import Any, Literal

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.jacobian_cost import JacobianCost, JacobianTerms, Rows
from hsp_control.robot import Robot

Form = Literal["determinant", "root", "log"]

FLOOR = 1e-6
"""Added in squares to every singular value, so that no state has an infinite slope."""


class Manipulability(JacobianCost):
    """f = -det(G), -√det(G) or -½ log det(G), with G = J W⁻¹ Jᵀ of a frame's rows.

    Yoshikawa (1985) maximises √det(J Jᵀ). The logarithm's slope grows towards a
    singularity, the determinant's vanishes there. W is a constant metric.
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
            length: What one radian is worth [m], where rows mix metres and radians.
            metric: A constant metric W, shape (nv, nv); None: the identity.
            name: What the log calls it.

        Raises:
            FieldError: If the form is unknown, or W is not positive definite.
            FrameNotFoundError: If the robot has no such frame.
        """
        super().__init__(robot, frame, rows=rows, axes=axes, length=length, name=name)
        if form not in ("determinant", "root", "log"):
            raise FieldError(
                f"field {name!r}: form {form!r}; choose determinant, root or log"
            )
        self.form = form
        self._W_inv = np.eye(robot.nv) if metric is None else _inverse(metric, robot.nv)
        # More where the metric's numbers are small: it must stand above G's rounding.
        self._floor = FLOOR**2 * max(1.0, 0.1 * float(np.trace(self._W_inv)) / robot.nv)

    def terms(self, J: Array, J_dot: Array) -> JacobianTerms:
        """Return f, its slope and rate; for φ = ½ log det G the slope is G⁻¹JW⁻¹."""
        JW, JW_dot = J @ self._W_inv, J_dot @ self._W_inv
        G = JW @ J.T + self._floor * np.eye(len(J))
        G_dot = JW_dot @ J.T
        G_dot += G_dot.T
        G_inv = np.linalg.inv(G)
        slope = G_inv @ JW
        slope_rate = G_inv @ (JW_dot - G_dot @ slope)
        half_log = 0.5 * float(np.linalg.slogdet(G)[1])
        if self.form == "log":
            return JacobianTerms(-half_log, -slope, -slope_rate)
        power = 1.0 if self.form == "root" else 2.0
        value = float(np.exp(power * half_log))
        value_rate = power * value * float(np.vdot(slope, J_dot))
        return JacobianTerms(
            -value,
            -power * value * slope,
            -power * (value * slope_rate + value_rate * slope),
        )


def _inverse(metric: Any, nv: int) -> Array:
    W = np.asarray(metric, dtype=float)
    if W.shape != (nv, nv) or not np.allclose(W, W.T):
        raise FieldError(f"metric has shape {W.shape}; needs ({nv}, {nv}), symmetric")
    if np.linalg.eigvalsh(W)[0] <= 0.0:
        raise FieldError("metric is not positive definite")
    return np.asarray(np.linalg.inv(W))
