"""The task of joint positions, which track a posture that may move."""

from dataclasses import KW_ONLY, replace
from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TaskError
from hsp_control.declaration import within
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Names
from hsp_control.engine.plans import PartCall
from hsp_control.geometry.scene import Start
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.state import Posture, configuration
from hsp_control.tasks.compliant_task import CompliantTask
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.trajectories import Hold, Stream, Trajectory
from hsp_control.trajectories.crossfade import AnyReference


class JointPosture(CompliantTask, type="joint_posture"):
    """e = q_d ⊖ q of some joints, with q_d(t) = reference ⊕ displacement(t).

    The joints have one degree of freedom, in rad or m. The error is exactly linear, and
    J are rows of the identity.
    """

    reference: Posture = "start"
    """The posture: ``start``, ``home``, nv joint positions or a configuration of nq
    numbers [rad or m]."""
    _: KW_ONLY
    joints: Names | None = None
    """Names of the joints, in the order of the rows [-]; all with one degree of freedom
    by default."""
    displacement: Given[Trajectory | None, ArrayLike] = default(None)
    """Motion of the joints about the reference, one number per joint [rad
    or m]; none by default. To stream postures, stream the displacement from a reference
    of zeros."""

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The joints."""
        return (ErrorPart("joints", "rad or m", "rad/s or m/s", len(self._joints)),)

    def _default_name(self) -> str:
        return "posture"

    @property
    def followed(self) -> Trajectory:
        """The displacement of a placed task."""
        if self.displacement is None:
            return Hold(np.zeros(len(self._joints)))
        return self.displacement

    def following(self, trajectory: AnyReference) -> Self:
        """Return the task with another displacement."""
        changes: dict[str, Any] = {"displacement": trajectory}  # checked there
        return replace(self, **changes)

    def placed(self, start: Start) -> Self:
        """Return the task with its configuration and its joints; see `Task.placed`."""
        robot: Robot = start.state.robot
        with within("reference"):
            reference = configuration(self.reference, start.state)
        joints, displacement = self.joints, self.displacement
        if joints is None:
            joints = [name for name, joint in robot.joints.items() if joint.nv == 1]
        placed = replace(self, reference=reference, joints=joints)
        with within("joints"):
            if not joints:
                raise TaskError("there is no joint")
            placed._indices(robot)  # checks them
        if displacement is not None:
            with within("displacement"):
                begin = np.zeros(len(joints))
                if isinstance(displacement, Stream):  # the present joint positions
                    away = robot.difference(reference, start.state.q)
                    begin = away[placed._indices(robot)]
                displacement = displacement.anchored(begin)
                if displacement.dimension != len(joints):
                    raise TaskError(
                        f"the task has {len(joints)} joints; its displacement has "
                        f"dimension {displacement.dimension}"
                    )
        return replace(placed, displacement=displacement).checked(robot)

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        robot = state.robot
        # The rows of `single_dof_joints`, in the order of the joints of the task.
        place = {int(row[0]): row for row in robot.single_dof_joints}
        joints = np.array([place[i] for i in self._indices(robot)], dtype=np.int64)
        return PartCall(
            engine.TrackPosture,
            q=state.q,
            v=state.v,
            reference=self._configuration(robot),
            joints=joints,
            displacement=self.followed,
        )

    def reference_rate(self, state: RobotState) -> Array:
        """Return the desired velocities of the joints, shape (m,) [rad/s or m/s]."""
        if self.displacement is None:
            return np.zeros(self.rows)
        return self.displacement.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual joint positions, shapes (m,) [rad or m].

        The desired position of a continuous joint is the one nearest to the actual
        position.
        """
        robot = state.robot
        indices = self._indices(robot)
        desired = self._configuration(robot)
        if self.displacement is not None:
            moved = np.zeros(robot.nv)
            moved[indices] = self.displacement.sample(state.t).position
            desired = robot.integrate(desired, moved)
        actual = robot.joint_positions(state.q)[indices]
        return actual + robot.difference(state.q, desired)[indices], actual

    def _indices(self, robot: Robot) -> list[int]:
        """Return the joints' indices in v."""
        indices = []
        for k, joint in enumerate(self._joints):
            if joint in self._joints[:k]:
                raise TaskError(f"joint {joint!r} is named twice")
            where = robot.velocity_index(joint)
            if where.stop - where.start != 1:
                raise TaskError(
                    f"joint {joint!r} has {where.stop - where.start} degrees of "
                    "freedom; a posture task needs joints with one (use a pose task "
                    "for a root)"
                )
            indices.append(where.start)
        return indices

    @property
    def _joints(self) -> tuple[str, ...]:
        if self.joints is None:
            raise self._not_placed("joints")
        return tuple(self.joints)

    def _configuration(self, robot: Robot) -> Array:
        """Return the reference, shape (nq,)."""
        if np.shape(self.reference) != (robot.nq,):
            raise self._not_placed("reference")
        return np.asarray(self.reference)
