"""Joints follow a posture that may move."""

from collections.abc import Sequence
from math import atan2, cos, sin
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import TaskError
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.configuration_space import joint_displacements
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import CompiledTask, TaskSample, track
from hsp_control.trajectories import Trajectory, TrajectorySample
from hsp_control.trajectories.following import stay


class JointPosture(CompiledTask):
    """Posture of some joints: e = q_d ⊖ q, exactly linear for one-freedom joints.

    q_d(t) = reference ⊕ displacement(t).

    Attributes:
        joints: Names of the joints.
    """

    def __init__(
        self,
        robot: Robot,
        reference: Any,
        gains: Gains,
        *,
        displacement: Trajectory | None = None,
        joints: Sequence[str] | None = None,
        name: str = "posture",
    ) -> None:
        """Set the task.

        Args:
            robot: The robot.
            reference: Configuration of the whole robot, shape (nq,).
            gains: Feedback gains.
            displacement: Motion of the named joints about the reference [rad or m], of
                dimension ``len(joints)``; None: none.
            joints: Names of the joints; None: all that have one freedom.
            name: What the log calls it.

        Raises:
            JointNotFoundError: If a joint does not exist.
            TaskError: If no joint is named, one twice, or one of several freedoms (a
                root: give it a pose task), or the displacement has another dimension.
            ShapeError: If the reference has the wrong shape.
        """
        self._reference = robot.check_configuration(reference).copy()
        indices = []
        if joints is None:
            joints = [name for name, joint in robot.joints.items() if joint.nv == 1]
        if not joints:
            raise TaskError(f"task {name!r} names no joint")
        for k, joint in enumerate(joints):
            if joint in joints[:k]:
                raise TaskError(f"task {name!r} names joint {joint!r} twice")
            where = robot.velocity_index(joint)
            if where.stop - where.start != 1:
                raise TaskError(
                    f"joint {joint!r} has {where.stop - where.start} freedoms; a "
                    "posture task holds joints of one (give a root a pose task)"
                )
            indices.append(where.start)
        super().__init__(robot, len(indices), gains, name)
        if displacement is not None and displacement.dimension != self.rows:
            raise TaskError(
                f"task {name!r} holds {self.rows} joints; its displacement has "
                f"dimension {displacement.dimension}"
            )
        self.joints = tuple(joints)
        self.displacement = displacement
        self._indices = np.array(indices, dtype=np.int64)
        self._moved = np.zeros(robot.nv)
        # The rows of `single_joints` that are held, in the order of the task's.
        place = {int(row[0]): row for row in robot.single_joints}
        self._rows: Indices = np.array([place[i] for i in indices], dtype=np.int64)

    def _calls(self, state: RobotState, out: TaskSample) -> StepPlan:
        sample, displacement = TrajectorySample.allocate(self.rows), self.displacement
        write = bind(
            _joint_posture,
            state.q,
            state.v,
            self._reference,
            self._rows,
            *sample,
            self.Kp,
            self.Kv,
            self.offset,
            np.zeros(self.robot.nv),
            *out,
        )
        follow = stay if displacement is None else displacement.follow(sample)
        return StepPlan((follow,), (write,))

    def reference_rate(self, state: RobotState) -> Array:
        """Return the joints' desired rates [rad/s or m/s]."""
        if self.displacement is None:
            return np.zeros(self.rows)
        return self.displacement.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual positions of the joints [rad or m]."""
        actual = self.robot.joint_positions(state.q)[self._indices]
        error = self.robot.difference(state.q, self._desired(state.t))[self._indices]
        return actual + error, actual

    def _desired(self, t: float) -> Array:
        if self.displacement is None:
            return self._reference
        self._moved[self._indices] = self.displacement.sample(t).position
        return self.robot.integrate(self._reference, self._moved)


@kernel
def _joint_posture(
    q: Array,
    v: Array,
    reference: Array,
    held: Indices,
    moved: Array,
    moved_dot: Array,
    moved_ddot: Array,
    Kp: Array,
    Kv: Array,
    offset: Array,
    away: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample: e = moved - (q ⊖ reference), the short way round."""
    joint_displacements(q, reference, held, away)
    for k in range(held.shape[0]):
        for j in range(J.shape[1]):
            J[k, j] = J_dot[k, j] = 0.0
        i = held[k, 0]
        J[k, i] = 1.0
        e[k] = moved[k] - away[i]
        if held[k, 2] == 2:
            e[k] = atan2(sin(e[k]), cos(e[k]))
        e_dot[k] = moved_dot[k] - v[i]
    track(moved_ddot, Kp, Kv, offset, e, e_dot, a_x)
