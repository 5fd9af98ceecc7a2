"""The paper's posture cost: neighbouring joints bend by the same angle."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import FieldError
from hsp_control.fields.cost import Cost
from hsp_control.robot import Robot, RobotState


class EqualJointAngles(Cost):
    """f = weight · Σ (q_{k+1} - q_k)² over consecutive named joints.

    The paper's third simulation has weight 5 and the planar arm's joints 2 and 3,
    whose positions are its relative angles θ̃2 and θ̃3. Differences are taken round the
    circle, so continuous joints may wind.
    """

    def __init__(
        self,
        robot: Robot,
        joints: Sequence[str],
        *,
        weight: float = 1.0,
        name: str = "equal_joint_angles",
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            joints: Two or more revolute joints, in order.
            weight: Weight ≥ 0 [1/s].
            name: What the log calls it.

        Raises:
            JointNotFoundError: If a joint does not exist.
            FieldError: If there are fewer than two joints, one has several freedoms,
                or the weight is negative.
        """
        super().__init__(robot, name)
        if len(joints) < 2:
            raise FieldError(f"field {name!r} needs two joints or more: {list(joints)}")
        if not 0.0 <= weight < np.inf:
            raise FieldError(f"field {name!r}: weight {weight} must be at least 0")
        slices = [robot.velocity_index(joint) for joint in joints]
        if any(where.stop - where.start != 1 for where in slices):
            raise FieldError(f"field {name!r}: each joint needs exactly one freedom")
        indices = [where.start for where in slices]
        # d = D q, one row for each pair of neighbours.
        self._D = np.zeros((len(joints) - 1, robot.nv))
        for row, (first, second) in enumerate(pairwise(indices)):
            self._D[row, first], self._D[row, second] = -1.0, 1.0
        self.weight = float(weight)

    def value(self, state: RobotState) -> float:
        """Return f."""
        d = self._differences(state)
        return float(self.weight * d @ d)

    def gradient(self, state: RobotState) -> Array:
        """Return 2 weight Dᵀd."""
        return 2.0 * self.weight * (self._differences(state) @ self._D)

    def gradient_rate(self, state: RobotState) -> Array:
        """Return 2 weight DᵀD v."""
        return 2.0 * self.weight * ((self._D @ state.v) @ self._D)

    def _differences(self, state: RobotState) -> Array:
        d = self._D @ self.robot.joint_positions(state.q)
        return (d + np.pi) % (2.0 * np.pi) - np.pi
