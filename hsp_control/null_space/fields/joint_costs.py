"""Costs of joint positions: centring, a posture, equal angles, a barrier at limits."""

from dataclasses import KW_ONLY, replace
from typing import Annotated, Self

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FieldError
from hsp_control.declaration import within
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Fraction, Names, Weights
from hsp_control.engine.plans import PartCall
from hsp_control.geometry.scene import Start
from hsp_control.null_space.fields.cost import Cost
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import Posture, configuration
from hsp_control.trajectories import Hold, Trajectory


class LimitedJointsCost(Cost):
    """A cost of the joints that have limits; others are ignored."""

    _: KW_ONLY
    weights: Weights = 1.0
    """w_i of the joints [1/s], one number or nv."""

    def placed(self, start: Start) -> Self:
        """Return the cost, checked; see `NullSpaceField.placed`."""
        robot = start.state.robot
        with within("weights"):
            per_dof(self.weights, robot.nv)
        if not limited_joints(robot).size:
            raise FieldError(
                f"no joint of {robot.name} has limits; use a target posture instead"
            )
        return self


class JointCentering(LimitedJointsCost, type="joint_centering"):
    """f = ½ Σ w_i ((q_i - m_i)/r_i)², m_i the middle and r_i half of the range.

    Joints without limits, continuous joints and a floating root are ignored. After
    Liégeois (1977), equation (11), scaled such that (q_i - m_i)/r_i is ±1 at a limit.
    Half a range of less than 1 rad or 1 m is replaced by that: otherwise a finger with
    a range of 4 cm would be pulled back at 2500 1/s, faster than any control period can
    follow.
    """

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Cost.call`."""
        robot = state.robot
        limited, (lower, upper) = limited_joints(robot), robot.position_limits()
        dofs = limited[:, 0]
        low, high = lower[dofs], upper[dofs]
        half = np.maximum(0.5 * (high - low), 1.0)
        stiffness = per_dof(self.weights, robot.nv)[dofs] / half**2
        middle = 0.5 * (low + high)
        return PartCall(
            engine.JointCentering,
            q=state.q,
            v=state.v,
            limited=limited,
            middle=middle,
            stiffness=stiffness,
        )


def limited_joints(robot: Robot) -> Indices:
    """Return the indices into v and q of the k joints with limits, shape (k, 2)."""
    lower, upper = robot.position_limits()
    limited = np.isfinite(lower) & np.isfinite(upper) & (upper > lower)
    return robot.single_dof_joints[limited[robot.single_dof_joints[:, 0]], :2].copy()


def per_dof(weights: ArrayLike, nv: int) -> Array:
    """Return weights of the joints as an array of shape (nv,)."""
    array = np.array(weights, dtype=float)
    if array.ndim == 0:
        return np.full(nv, float(array))
    if array.shape != (nv,):
        raise FieldError(f"weights have shape {array.shape}; needs one number or {nv}")
    return array


class TargetPosture(Cost, type="target_posture"):
    """f = Σ w_i ½d_i², d = q ⊖ target(t); Σ w_i (1 - cos d_i) for continuous joints.

    The two forms differ by terms of fourth order. The second is smooth at all angles,
    whereas ½d² has a kink at an angle of π from the target. Joints with several degrees
    of freedom, such as a floating root, are ignored: use a task for them.
    """

    target: Posture = "start"
    """The posture: ``start``, ``home``, nv joint positions or a configuration of nq
    numbers [rad or m]."""
    _: KW_ONLY
    weights: Weights = 1.0
    """w_i of the joints [1/s], one number or nv."""
    displacement: Given[Trajectory | None, ArrayLike] = default(None)
    """Motion of the target: nv numbers that are added to it [rad or m]; none by
    default. A stream can move it only in a change of the running controller."""

    def placed(self, start: Start) -> Self:
        """Return the cost with its posture as a configuration, checked."""
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

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Cost.call`."""
        robot = state.robot
        if isinstance(self.target, str) or np.shape(self.target) != (robot.nq,):
            raise self._not_placed("posture")
        target = np.asarray(self.target, dtype=float)
        moved = self.displacement or Hold(np.zeros(robot.nv))
        return PartCall(
            engine.TargetPosture,
            q=state.q,
            v=state.v,
            target=target,
            displacement=moved,
            single_dof_joints=robot.single_dof_joints,
            weights=per_dof(self.weights, robot.nv),
        )


class EqualJointAngles(Cost, type="equal_joint_angles"):
    """f = Σ (q_{k+1} - q_k)² [1/s] over consecutive joints of a list.

    The paper's third simulation has the weight 5 and the joints 2 and 3 of the planar
    arm, whose positions are the paper's relative angles θ̃2 and θ̃3. Differences are
    wrapped to [-π, π), so that full turns of continuous joints make no difference.
    """

    joints: Annotated[Names, Field(min_length=2)]
    """Names of two or more single-DOF joints, in order [-]."""

    def placed(self, start: Start) -> Self:
        """Return the cost, checked."""
        for k, joint in enumerate(self.joints):
            with within("joints", k):
                where = start.state.robot.velocity_index(joint)
                size = where.stop - where.start
                if size != 1:
                    raise FieldError(
                        f"joint {joint!r} has {size} degrees of freedom; needs 1"
                    )
        return self

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Cost.call`."""
        robot = state.robot
        chain = [robot.velocity_index(joint).start for joint in self.joints]
        return PartCall(
            engine.EqualJointAngles,
            q=state.q,
            v=state.v,
            neutral=robot.neutral(),
            single_dof_joints=robot.single_dof_joints,
            chain=np.array(chain, dtype=np.int64),
        )


class LimitBarrier(LimitedJointsCost, type="limit_barrier"):
    """f = Σ w_i (b((q_i - lower_i)/u_i) + b((upper_i - q_i)/u_i)).

    u_i is ``zone`` times half the range, and b(s) = -(1 - s)² ln s below 1, 0 beyond: a
    joint contributes to f only within the distance u_i of a limit. Joints without
    limits, continuous joints and a floating root are ignored.
    """

    zone: Fraction = 0.3
    """Width of the zone before a limit, as a fraction of half the range, at most 1
    [-]."""

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Cost.call`."""
        robot = state.robot
        limited, (low, high) = limited_joints(robot), robot.position_limits()
        dofs = limited[:, 0]
        lower, upper = low[dofs], high[dofs]
        unit = 0.5 * self.zone * (upper - lower)  # u_i
        weights = per_dof(self.weights, robot.nv)[dofs]
        return PartCall(
            engine.LimitBarrier,
            q=state.q,
            v=state.v,
            limited=limited,
            lower=lower,
            upper=upper,
            unit=unit,
            weights=weights,
        )
