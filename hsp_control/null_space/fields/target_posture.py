"""The cost of joints far from a target posture."""

from dataclasses import KW_ONLY, replace
from math import cos, sin
from typing import Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import FieldError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields.compiled_cost import CompiledCost, Derivatives
from hsp_control.null_space.fields.joint_centering import per_dof
from hsp_control.robot import RobotState
from hsp_control.robot.configuration_space import joint_displacements
from hsp_control.robot.postures import Posture, configuration
from hsp_control.trajectories import Trajectory, TrajectorySample


class TargetPosture(CompiledCost, type="target_posture"):
    """f = Σ w_i ½d_i², d = q ⊖ target(t); Σ w_i (1 - cos d_i) for continuous joints.

    The two forms differ by terms of fourth order. The second is smooth at all angles,
    whereas ½d² has a kink at an angle of π from the target. Joints with several degrees
    of freedom, such as a floating root, do not count: use a task for them.
    """

    target: Posture = "start"
    """The posture: ``start``, ``home``, nv joint positions or a configuration of nq
    numbers [rad or m]."""
    _: KW_ONLY
    weights: Weights = 1.0
    """w_i of the joints [1/s], one number or nv."""
    displacement: Trajectory | None = None
    """Motion of the target: nv numbers that are added to it [rad or m]; none by
    default. A stream leads it only in a change of the running controller."""

    def placed(self, start: Start) -> Self:
        """Return the cost with its posture as a configuration, checked.

        Raises:
            FieldError: If the weights do not fit the robot, or every weight of a joint
                with one degree of freedom is 0.
            HspControlError: If the posture does not fit the robot.
        """
        robot = start.state.robot
        with within("weights"):
            weights = per_dof(self.weights, robot.nv)
            if not weights[robot.single_dof_joints[:, 0]].any():
                raise FieldError("every weight is 0")
        displacement = self.displacement
        if displacement is not None:
            with within("displacement"):
                displacement = displacement.anchored(np.zeros(robot.nv))
                if displacement.dimension != robot.nv:
                    raise FieldError(
                        f"it has dimension {displacement.dimension}; the robot has "
                        f"{robot.nv} degrees of freedom"
                    )
        with within("target"):
            target = configuration(self.target, start.state)
        return replace(self, target=target, displacement=displacement)

    def _compile(self, state: RobotState, gradient: Array, rate: Array) -> Derivatives:
        robot = state.robot
        if isinstance(self.target, str) or np.shape(self.target) != (robot.nq,):
            raise self._not_placed("posture")
        moved = TrajectorySample.allocate(robot.nv)
        derivatives = bind(
            _posture,
            state.q,
            state.v,
            np.asarray(self.target, dtype=float),
            moved.position,
            moved.velocity,
            robot.single_dof_joints,
            per_dof(self.weights, robot.nv),
            gradient,
            rate,
        )
        if self.displacement is None:
            return derivatives
        follow = self.displacement.follow(moved)

        def followed() -> float:
            follow(state.t)
            return float(derivatives())

        return followed


@kernel
def _posture(
    q: Array,
    v: Array,
    target: Array,
    moved: Array,
    moved_rate: Array,
    single_dof_joints: Indices,
    weights: Array,
    gradient: Array,
    rate: Array,
) -> float:
    """Write ∇f = w d (continuous joints: w sin d) and its rate, and return f."""
    for i in range(v.shape[0]):
        gradient[i] = rate[i] = 0.0
    joint_displacements(q, target, single_dof_joints, gradient)
    f = 0.0
    for k in range(single_dof_joints.shape[0]):
        i = single_dof_joints[k, 0]
        d, d_dot = gradient[i] - moved[i], v[i] - moved_rate[i]
        if single_dof_joints[k, 2] == 1:
            f += 0.5 * weights[i] * d * d
            gradient[i] = weights[i] * d
            rate[i] = weights[i] * d_dot
        else:
            f += weights[i] * (1.0 - cos(d))
            gradient[i] = weights[i] * sin(d)
            rate[i] = weights[i] * cos(d) * d_dot
    return f
