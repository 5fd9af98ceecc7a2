"""The paper's posture cost: neighbouring joints have equal angles."""

from math import pi
from typing import Annotated, Self

import numpy as np
from pydantic import Field

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Names
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.robot import RobotState
from hsp_control.robot.configuration_space import joint_displacements


class EqualJointAngles(CompiledCost, type="equal_joint_angles"):
    """f = Σ (q_{k+1} - q_k)² [1/s] over consecutive joints of a list.

    The paper's third simulation has the weight 5 and the joints 2 and 3 of the planar
    arm, whose positions are the paper's relative angles θ̃2 and θ̃3. Differences are
    wrapped to [-π, π), so that full turns of continuous joints do not count.
    """

    joints: Annotated[Names, Field(min_length=2)]
    """Names of two or more joints with one degree of freedom each, in order [-]."""

    def placed(self, start: Start) -> Self:
        """Return the cost, checked.

        Raises:
            JointNotFoundError: If a joint does not exist.
            FieldError: If a joint has several degrees of freedom.
        """
        for k, joint in enumerate(self.joints):
            with within("joints", k):
                where = start.state.robot.velocity_index(joint)
                size = where.stop - where.start
                if size != 1:
                    raise FieldError(
                        f"joint {joint!r} has {size} degrees of freedom; needs 1"
                    )
        return self

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        robot = state.robot
        chain = [robot.velocity_index(joint).start for joint in self.joints]
        return bind(
            _equal_angles,
            state.q,
            state.v,
            robot.neutral(),
            robot.single_dof_joints,
            np.array(chain, dtype=np.int64),
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
        slope, slope_dot = 2.0 * d, 2.0 * (v[j] - v[i])
        gradient[i] -= slope
        gradient[j] += slope
        rate[i] -= slope_dot
        rate[j] += slope_dot
        f += d * d
    return f
