"""Keep the joints off their limits, and leave them alone elsewhere."""

from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.barrier import barrier
from hsp_control.fields.cost import Cost
from hsp_control.fields.joint_centering import check_weights
from hsp_control.robot import Robot, RobotState


class LimitBarrier(Cost):
    """f = Σ w_i (b(q_i - lower_i) + b(upper_i - q_i)), zero in the middle of the range.

    b is the barrier of `hsp_control.fields.barrier`; it begins at a fraction of half
    the range from a limit. Joints without limits, continuous ones and a floating root
    are left free.
    """

    def __init__(
        self,
        robot: Robot,
        *,
        zone: float = 0.3,
        weights: Any = 1.0,
        name: str = "limit_barrier",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            zone: Where it begins, as a fraction of half the range, within (0, 1].
            weights: w_i ≥ 0, one number or one per freedom, shape (nv,).
            name: What the log calls it.

        Raises:
            FieldError: If the zone is out of range, a weight negative, or no joint has
                limits.
        """
        super().__init__(robot, name)
        if not 0.0 < zone <= 1.0:
            raise FieldError(f"field {name!r}: zone {zone} must be within (0, 1]")
        w = check_weights(weights, robot.nv, name)
        lower, upper = robot.position_limits()
        limited = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
        if not limited.any():
            raise FieldError(f"field {name!r}: no joint of {robot.name} has limits")
        self._limited = np.flatnonzero(limited)
        self._weights = w[limited]
        self._lower, self._upper = lower[limited], upper[limited]
        # Distances are measured in units of the zone: the barrier begins at 1.
        self._unit = 0.5 * zone * (self._upper - self._lower)
        count = len(self._limited)
        self._slopes, self._bends = np.zeros((2, count)), np.zeros((2, count))

    def value(self, state: RobotState) -> float:
        """Return f."""
        total = 0.0
        for side, distance in enumerate(self._distances(state)):
            for k in range(len(distance)):
                total += self._weights[k] * barrier(
                    distance[k : k + 1],
                    1.0,
                    self._slopes[side, k : k + 1],
                    self._bends[side, k : k + 1],
                )
        return total

    def gradient(self, state: RobotState) -> Array:
        """Return ∇f."""
        self.value(state)
        result = np.zeros(self.robot.nv)
        slope = (self._slopes[0] - self._slopes[1]) / self._unit
        result[self._limited] = self._weights * slope
        return result

    def gradient_rate(self, state: RobotState) -> Array:
        """Return ∇²f v, exact."""
        self.value(state)
        result = np.zeros(self.robot.nv)
        bend = (self._bends[0] + self._bends[1]) / self._unit**2
        result[self._limited] = self._weights * bend * state.v[self._limited]
        return result

    def _distances(self, state: RobotState) -> tuple[Array, Array]:
        q = self.robot.joint_positions(state.q)[self._limited]
        return (q - self._lower) / self._unit, (self._upper - q) / self._unit
