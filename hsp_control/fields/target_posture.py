"""Draw the joints towards a posture."""

from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.cost import Cost
from hsp_control.fields.joint_centering import check_weights
from hsp_control.robot import Robot, RobotState


class TargetPosture(Cost):
    """f = Σ w_i ½d_i², d = q ⊖ target; Σ w_i (1 - cos d_i) for continuous joints.

    The second form agrees with the first to fourth order and is smooth all the way
    round, where ½d² would have a kink opposite the target. Roots and other joints of
    several freedoms are left free: give them a task.
    """

    def __init__(
        self,
        robot: Robot,
        target: Any,
        *,
        weights: Any = 1.0,
        name: str = "target_posture",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            target: Configuration, shape (nq,).
            weights: w_i ≥ 0 [1/s], one number or one per freedom, shape (nv,).
            name: What the log calls it.

        Raises:
            FieldError: If a weight is negative, or no weighted joint has one freedom.
            ShapeError: If the target has the wrong shape.
        """
        super().__init__(robot, name)
        self.target = robot.check_configuration(target).copy()
        single = np.zeros(robot.nv, dtype=bool)
        self._round = np.zeros(robot.nv, dtype=bool)
        for joint in robot.joints.values():
            if joint.nv == 1:
                single[joint.idx_v] = True
                self._round[joint.idx_v] = joint.nq == 2
        self._weights = np.where(single, check_weights(weights, robot.nv, name), 0.0)
        if not self._weights.any():
            raise FieldError(f"field {name!r}: every weight is 0")

    def value(self, state: RobotState) -> float:
        """Return f."""
        d = self._away(state)
        terms = np.where(self._round, 1.0 - np.cos(d), 0.5 * d**2)
        return float(self._weights @ terms)

    def gradient(self, state: RobotState) -> Array:
        """Return w_i d_i, or w_i sin d_i."""
        d = self._away(state)
        return self._weights * np.where(self._round, np.sin(d), d)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return w_i v_i, or w_i cos d_i v_i."""
        slope = np.where(self._round, np.cos(self._away(state)), 1.0)
        return self._weights * slope * state.v

    def _away(self, state: RobotState) -> Array:
        return self.robot.difference(self.target, state.q)
