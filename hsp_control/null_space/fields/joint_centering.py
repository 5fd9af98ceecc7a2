"""The cost of joints far from the middle of their range."""

from dataclasses import KW_ONLY
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.robot import Robot, RobotState


class JointCentering(CompiledCost, type="joint_centering"):
    """f = ½ Σ w_i ((q_i - m_i)/r_i)², m_i the middle and r_i half of the range.

    Joints without limits, continuous joints and a floating root do not count. After
    Liégeois (1977), equation (11), scaled such that (q_i - m_i)/r_i is ±1 at a limit.
    Half a range of less than 1 rad or 1 m counts as that: else a finger that opens by
    4 cm would be drawn back at 2500 1/s, faster than any control period can follow.
    """

    _: KW_ONLY
    weights: Weights = 1.0
    """w_i of the joints [1/s], one number or nv."""

    def placed(self, start: Start) -> Self:
        """Return the cost, checked.

        Raises:
            FieldError: If the weights do not fit the robot, or no joint has limits.
        """
        robot = start.state.robot
        with within("weights"):
            per_dof(self.weights, robot.nv)
        if not limited_joints(robot).size:
            raise FieldError(
                f"no joint of {robot.name} has limits, so no range has a middle; use a "
                "target posture instead"
            )
        return self

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        robot = state.robot
        limited, (lower, upper) = limited_joints(robot), robot.position_limits()
        dofs = limited[:, 0]
        low, high = lower[dofs], upper[dofs]
        half = np.maximum(0.5 * (high - low), 1.0)
        stiffness = per_dof(self.weights, robot.nv)[dofs] / half**2
        return bind(
            _centering,
            state.q,
            state.v,
            limited,
            0.5 * (low + high),
            stiffness,
            gradient,
            rate,
        )


def limited_joints(robot: Robot) -> Indices:
    """Return the indices into v and q of the k joints with limits, shape (k, 2)."""
    lower, upper = robot.position_limits()
    limited = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    return robot.single_dof_joints[limited[robot.single_dof_joints[:, 0]], :2].copy()


@kernel
def _centering(
    q: Array,
    v: Array,
    limited: Indices,
    middle: Array,
    stiffness: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f = k_i (q_i - m_i) and (∇f)' = k_i v_i, and return f; k_i = w_i/r_i²."""
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    f = 0.0
    for k in range(limited.shape[0]):
        i, at = limited[k, 0], limited[k, 1]
        away = q[at] - middle[k]
        gradient[i] = stiffness[k] * away
        rate[i] = stiffness[k] * v[i]
        f += 0.5 * stiffness[k] * away * away
    return f


def per_dof(weights: ArrayLike, nv: int) -> Array:
    """Return weights of the joints as an array of shape (nv,)."""
    array = np.array(weights, dtype=float)
    if array.ndim == 0:
        return np.full(nv, float(array))
    if array.shape != (nv,):
        raise FieldError(f"weights have shape {array.shape}; needs one number or {nv}")
    return array
