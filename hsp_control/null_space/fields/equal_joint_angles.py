"""The paper's posture cost: neighbouring joints have equal angles."""

from collections.abc import Sequence
from math import pi

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.configuration_space import joint_displacements


class EqualJointAngles(CompiledCost):
    """f = weight · Σ (q_{k+1} - q_k)² over consecutive joints of a list.

    The paper's third simulation has weight 5 and the joints 2 and 3 of the planar arm,
    whose positions are the paper's relative angles θ̃2 and θ̃3. Differences are
    wrapped to [-π, π), so that full turns of continuous joints do not count.

    Attributes:
        weight: The weight [1/s].
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
            joints: Names of two or more revolute joints, in order.
            weight: Weight ≥ 0 [1/s].
            name: Name of the field in the log.

        Raises:
            JointNotFoundError: If a joint does not exist.
            FieldError: If there are fewer than two joints, a joint has several degrees
                of freedom, or the weight is negative or not finite.
        """
        super().__init__(robot, name)
        if len(joints) < 2:
            raise FieldError(
                f"field {name!r} needs at least two joints; got {list(joints)}"
            )
        if not 0.0 <= weight < np.inf:
            raise FieldError(f"field {name!r}: weight {weight} must be at least 0")
        slices = [robot.velocity_index(joint) for joint in joints]
        if any(where.stop - where.start != 1 for where in slices):
            raise FieldError(
                f"field {name!r}: each joint needs exactly one degree of freedom"
            )
        indices = [where.start for where in slices]
        self._chain: Indices = np.array(indices, dtype=np.int64)
        self.weight = float(weight)

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        robot = self.robot
        return bind(
            _equal_angles,
            state.q,
            state.v,
            robot.neutral(),
            robot.single_dof_joints,
            self._chain,
            self.weight,
            np.zeros(robot.nv),
            gradient,
            rate,
        )


@kernel
def _equal_angles(
    q: Array,
    v: Array,
    neutral: Array,
    single_dof_joints: Indices,
    chain: Indices,
    weight: float,
    angles: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f and (∇f)' with d_k = q_{k+1} - q_k in [-π, π), and return f."""
    joint_displacements(q, neutral, single_dof_joints, angles)
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    f = 0.0
    for k in range(chain.shape[0] - 1):
        i, j = chain[k], chain[k + 1]
        d = (angles[j] - angles[i] + pi) % (2.0 * pi) - pi
        slope, slope_dot = 2.0 * weight * d, 2.0 * weight * (v[j] - v[i])
        gradient[i] -= slope
        gradient[j] += slope
        rate[i] -= slope_dot
        rate[j] += slope_dot
        f += weight * d * d
    return f
