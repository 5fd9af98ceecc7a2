"""The cost of joints far from the middle of their range."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.robot import Robot, RobotState


class JointCentering(CompiledCost):
    """f = ½ Σ w_i ((q_i - m_i)/r_i)², m_i the middle and r_i half of the range.

    Joints without limits, continuous joints and a floating root do not count. After
    Liégeois (1977), equation (11), scaled such that (q_i - m_i)/r_i is ±1 at a limit.
    """

    def __init__(
        self, robot: Robot, *, weights: Any = 1.0, name: str = "joint_centering"
    ) -> None:
        """Set the cost.

        Args:
            robot: The robot.
            weights: w_i ≥ 0, one number or one per degree of freedom, shape (nv,).
            name: Name of the field in the log.

        Raises:
            FieldError: If a weight is negative or not finite, or no joint has limits.
        """
        super().__init__(robot, name)
        w = check_weights(weights, robot.nv, name)
        lower, upper = robot.position_limits()
        self._limited = limited_joints(robot)
        if not self._limited.size:
            raise FieldError(
                f"field {name!r}: no joint of {robot.name} has limits, so no range has "
                "a middle; use a target posture instead"
            )
        dofs = self._limited[:, 0]
        low, high = lower[dofs], upper[dofs]
        self._middle = 0.5 * (low + high)
        self._stiffness = w[dofs] / (0.5 * (high - low)) ** 2

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        return bind(
            _centering,
            state.q,
            state.v,
            self._limited,
            self._middle,
            self._stiffness,
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


def check_weights(weights: Any, size: int, name: str) -> Array:
    """Return weights as an array of shape (size,).

    Raises:
        FieldError: If they have another size, or one is negative or not finite.
    """
    array = np.array(weights, dtype=float)
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
