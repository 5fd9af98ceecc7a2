"""Draw the joints towards a posture."""

from math import cos, sin
from typing import Any

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.null_space.fields.joint_centering import check_weights
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.configuration_space import joint_displacements


class TargetPosture(CompiledCost):
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
        self._weights = check_weights(weights, robot.nv, name)
        if not self._weights[robot.single_joints[:, 0]].any():
            raise FieldError(f"field {name!r}: every weight is 0")

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        return bind(
            _posture,
            state.q,
            state.v,
            self.target,
            self.robot.single_joints,
            self._weights,
            gradient,
            rate,
        )


@kernel
def _posture(
    q: Array,
    v: Array,
    target: Array,
    single_joints: Indices,
    weights: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write w_i d_i and w_i v_i, or w_i sin d_i and w_i cos d_i v_i; return f."""
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    joint_displacements(q, target, single_joints, gradient)
    f = 0.0
    for k in range(single_joints.shape[0]):
        i, d = single_joints[k, 0], gradient[single_joints[k, 0]]
        if single_joints[k, 2] == 1:
            f += 0.5 * weights[i] * d * d
            gradient[i] = weights[i] * d
            rate[i] = weights[i] * v[i]
        else:
            f += weights[i] * (1.0 - cos(d))
            gradient[i] = weights[i] * sin(d)
            rate[i] = weights[i] * cos(d) * v[i]
    return f
