"""The task of joint positions, which track a posture that may move."""

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
from hsp_control.tasks.task import CompiledTask, Feedback, TaskSample, add_feedback
from hsp_control.trajectories import Trajectory, TrajectorySample
from hsp_control.trajectories.following import stay


class JointPosture(CompiledTask):
    """e = q_d ⊖ q of some joints, with q_d(t) = reference ⊕ displacement(t).

    Each joint has one degree of freedom, in rad or m. The error is exactly linear, and
    J are rows of the identity.

    Attributes:
        joints: Names of the joints, in the order of the rows.
        displacement: Motion of the joints about the reference, or None.
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
            gains: Feedback gains of the rows, one row per joint.
            displacement: Motion of the joints about the reference [rad or m], of
                dimension ``len(joints)``; None: the posture is constant.
            joints: Names of the joints; None: all with one degree of freedom.
            name: Name of the task in the log.

        Raises:
            JointNotFoundError: If a joint does not exist.
            TaskError: If there is no joint, a joint is named twice, a joint has several
                degrees of freedom (a floating root: use a pose task), or the
                displacement has another dimension.
            ShapeError: If the reference has the wrong shape.
            GainError: If the gains do not fit the rows.
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
                    f"joint {joint!r} has {where.stop - where.start} degrees of "
                    "freedom; a posture task needs joints with one (use a pose task "
                    "for a root)"
                )
            indices.append(where.start)
        super().__init__(robot, len(indices), gains, name)
        if displacement is not None and displacement.dimension != self.rows:
            raise TaskError(
                f"task {name!r} has {self.rows} joints; its displacement has "
                f"dimension {displacement.dimension}"
            )
        self.joints = tuple(joints)
        self.displacement = displacement
        self._indices = np.array(indices, dtype=np.int64)
        self._moved = np.zeros(robot.nv)
        # The rows of `single_dof_joints`, in the order of the joints of the task.
        place = {int(row[0]): row for row in robot.single_dof_joints}
        self._rows: Indices = np.array([place[i] for i in indices], dtype=np.int64)

    def _step_plan(self, state: RobotState, out: TaskSample) -> StepPlan:
        sample, displacement = TrajectorySample.allocate(self.rows), self.displacement
        write = bind(
            _joint_posture,
            state.q,
            state.v,
            self._reference,
            self._rows,
            sample,
            self.feedback,
            np.zeros(self.robot.nv),
            out,
        )
        follow = stay if displacement is None else displacement.follow(sample)
        return StepPlan((follow,), (write,))

    def reference_rate(self, state: RobotState) -> Array:
        """Return the desired velocities of the joints, shape (m,) [rad/s or m/s]."""
        if self.displacement is None:
            return np.zeros(self.rows)
        return self.displacement.sample(state.t).velocity

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual joint positions, shape (m,) each [rad or m].

        The desired position of a continuous joint is the one nearest to the actual
        position.
        """
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
    joints: Indices,
    desired: TrajectorySample,
    feedback: Feedback,
    away: Array,
    out: TaskSample,
) -> None:
    """Write the sample: e = displacement - (q ⊖ reference), within ±π if continuous."""
    displacement, displacement_dot, displacement_ddot = desired
    J, J_dot, e, e_dot, a_x = out
    joint_displacements(q, reference, joints, away)
    for k in range(joints.shape[0]):
        for j in range(J.shape[1]):
            J[k, j] = J_dot[k, j] = 0.0
        i = joints[k, 0]
        J[k, i] = 1.0
        e[k] = displacement[k] - away[i]
        if joints[k, 2] == 2:
            e[k] = atan2(sin(e[k]), cos(e[k]))
        e_dot[k] = displacement_dot[k] - v[i]
    add_feedback(displacement_ddot, feedback, e, e_dot, a_x)
