"""Joints follow a posture that may move."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import TaskError
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.task import Task, TaskSample, track
from hsp_control.trajectories import Trajectory, TrajectorySample


class JointPosture(Task):
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
        self._sample = TrajectorySample.allocate(self.rows)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return one row a joint; see `Task.evaluate`."""
        if out is None:
            out = TaskSample.allocate(self.rows, self.robot.nv)
        desired = self._desired(state.t)
        difference = self.robot.difference(state.q, desired)
        out.jacobian[:] = 0.0
        out.jacobian[np.arange(self.rows), self._indices] = 1.0
        out.jacobian_dot[:] = 0.0
        out.error[:] = difference[self._indices]
        out.error_rate[:] = self._sample.velocity - state.v[self._indices]
        track(
            self._sample.acceleration,
            self.Kp,
            self.Kv,
            out.error,
            out.error_rate,
            out.acceleration,
        )
        return out

    def reference_rate(self, state: RobotState) -> Array:
        """Return the joints' desired rates [rad/s or m/s]."""
        self._desired(state.t)
        return self._sample.velocity.copy()

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual positions of the joints [rad or m]."""
        actual = self.robot.joint_positions(state.q)[self._indices]
        error = self.robot.difference(state.q, self._desired(state.t))[self._indices]
        return actual + error, actual

    def _desired(self, t: float) -> Array:
        if self.displacement is None:
            return self._reference
        self.displacement.sample(t, self._sample)
        self._moved[self._indices] = self._sample.position
        return self.robot.integrate(self._reference, self._moved)
