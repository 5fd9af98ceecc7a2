"""The cost of joints far from a target posture."""

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

    The two forms differ by terms of fourth order. The second is smooth at all angles,
    whereas ½d² has a kink at an angle of π from the target. Joints with several degrees
    of freedom, such as a floating root, do not count: use a task for them.

    Attributes:
        target: The posture, shape (nq,).
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
            weights: w_i ≥ 0 [1/s], one number or one per degree of freedom, shape
                (nv,).
            name: Name of the field in the log.

        Raises:
            FieldError: If a weight is negative or not finite, or every weight of a
                joint with one degree of freedom is 0.
            ShapeError: If the target has the wrong shape.
        """
        super().__init__(robot, name)
        self.target = robot.check_configuration(target).copy()
        self._weights = check_weights(weights, robot.nv, name)
        if not self._weights[robot.single_dof_joints[:, 0]].any():
            raise FieldError(f"field {name!r}: every weight is 0")

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        return bind(
            _posture,
            state.q,
            state.v,
            self.target,
            self.robot.single_dof_joints,
            self._weights,
            gradient,
            rate,
        )


@kernel
def _posture(
    q: Array,
    v: Array,
    target: Array,
    single_dof_joints: Indices,
    weights: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f = w_i d_i and (∇f)' = w_i v_i, and return f.

    For continuous joints ∇f = w_i sin d_i and (∇f)' = w_i cos d_i v_i.
    """
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    joint_displacements(q, target, single_dof_joints, gradient)
    f = 0.0
    for k in range(single_dof_joints.shape[0]):
        i, d = single_dof_joints[k, 0], gradient[single_dof_joints[k, 0]]
        if single_dof_joints[k, 2] == 1:
            f += 0.5 * weights[i] * d * d
            gradient[i] = weights[i] * d
            rate[i] = weights[i] * v[i]
        else:
            f += weights[i] * (1.0 - cos(d))
            gradient[i] = weights[i] * sin(d)
            rate[i] = weights[i] * cos(d) * v[i]
    return f
