"""Keep the joints near the middle of their range."""

from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.cost import Cost
from hsp_control.robot import Robot, RobotState


class JointCentering(Cost):
    """f = ½ Σ w_i ((q_i - m_i)/r_i)², m_i and r_i the middle and half of the range.

    Joints without limits, continuous ones and a floating root are left free. After
    Liégeois (1977), equation (11), normalised to 1 at a limit.
    """

    def __init__(
        self, robot: Robot, *, weights: Any = 1.0, name: str = "joint_centering"
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            weights: w_i ≥ 0, one number or one per freedom, shape (nv,).
            name: What the log calls it.

        Raises:
            FieldError: If a weight is negative or no joint has limits.
        """
        super().__init__(robot, name)
        w = check_weights(weights, robot.nv, name)
        lower, upper = robot.position_limits()
        limited = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
        if not limited.any():
            raise FieldError(
                f"field {name!r}: no joint of {robot.name} has limits, so none has a "
                "middle; use a target posture instead"
            )
        # Away from here the limits are infinite, and inf - inf is no number.
        low, high = lower[limited], upper[limited]
        self._middle, self._stiffness = np.zeros(robot.nv), np.zeros(robot.nv)
        self._middle[limited] = 0.5 * (low + high)
        self._stiffness[limited] = w[limited] / (0.5 * (high - low)) ** 2

    def value(self, state: RobotState) -> float:
        """Return f."""
        away = self._away(state)
        return float(0.5 * self._stiffness @ away**2)

    def gradient(self, state: RobotState) -> Array:
        """Return w_i (q_i - m_i)/r_i²."""
        return self._stiffness * self._away(state)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return w_i v_i/r_i²."""
        return self._stiffness * state.v

    def _away(self, state: RobotState) -> Array:
        return self.robot.joint_positions(state.q) - self._middle


def check_weights(weights: Any, size: int, name: str) -> Array:
    """Return weights as an array of shape (size,).

    Raises:
        FieldError: If there are not as many, or one is negative or not finite.
    """
    array = np.asarray(weights, dtype=float)
    if array.ndim == 0:
        array = np.full(size, float(array))
    if array.shape != (size,):
        raise FieldError(
            f"field {name!r}: weights have shape {array.shape}; "
            f"needs one number or {size}"
        )
    if not ((array >= 0.0) & np.isfinite(array)).all():
        raise FieldError(
            f"field {name!r}: weights {array.tolist()} must be finite and at least 0"
        )
    return array
