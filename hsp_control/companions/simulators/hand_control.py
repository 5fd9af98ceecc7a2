"""A controller of one hand that receives targets while it runs."""

from dataclasses import fields
from math import nan
from typing import Any, cast

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import NonFiniteError
from hsp_control.companions.simulators.hand_settings import Source, read_settings
from hsp_control.companions.simulators.held_goal import HeldPoint, HeldRotation
from hsp_control.control.interface import CompensatedController, Controller
from hsp_control.robot import Robot
from hsp_control.tasks import FramePose, FramePosition, Gains, Task
from hsp_control.tasks.frame_position import axis_indices
from hsp_control.trajectories import ComposedPose, Stream, StreamPose

_JUMP = 1.5
"""Difference from the expected time beyond which the simulation was reset [periods]."""


class HandControl:
    """The law for one hand of a simulated arm, with a target at any step.

    The posture in which a run begins is the start for fields.

    Attributes:
        robot: The arm.
        frame: The hand's frame.
        axes: The tracked axes of the world; None: the whole pose.
        compensated: The controller and its compensators.
    """

    def __init__(
        self,
        robot: Robot,
        frame: str,
        source: Source = None,
        *,
        gains: Gains,
        axes: str | None = None,
    ) -> None:
        """Compose the controller.

        Args:
            robot: The arm.
            frame: The hand's frame.
            source: The settings.
            gains: The gains of the hand's task, unless the settings have some.
            axes: World axes of a position, such as ``xyz``; None: the whole pose.

        Raises:
            HspControlError: If a setting is wrong, or does not fit the arm; with file
                and line.
        """
        settings, document = read_settings(source)
        self.robot, self.frame, self.axes = robot, frame, axes
        self._streams = settings.stream is not None
        self._point, self._rotation = HeldPoint(), HeldRotation()
        with document.at():
            null_space = settings.null_space
            controller = Controller(
                robot,
                [self._task(settings.gains or gains, settings.stream)],
                null_space.field,
                null_space_gain=null_space.gain,
                metric=null_space.metric,
                singularity_threshold=null_space.singularity_threshold,
                limits=settings.limits,
                scene=settings.scene,
            )
            # The robot is the simulator's, and touching objects is not an error.
            own = settings.compensation.suited(controller, None, exact=True)
            self.compensated = CompensatedController(controller, own)
        self._indices = axis_indices(axes or "")  # now that the task has checked them
        self._strongest = robot.model.upperEffortLimit
        self._expected, self._period = nan, nan

    def begin(self, t: float, q: Array, v: Array) -> None:
        """Begin a run: reset all, and set the target to the hand's pose.

        Args:
            t: Time [s].
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,).
        """
        self.compensated.restart(origin=0.0)
        self.compensated.controller.compute(
            t, q, v
        )  # places the parts relative to the start
        self._expected = nan

    def has_jumped(self, t: float) -> bool:
        """Return whether a time [s] does not follow the last effort's.

        Then the simulation was reset, or another state was loaded.
        """
        return abs(t - self._expected) > _JUMP * self._period

    def aim(self, goal: pin.SE3, t: float) -> None:
        """Set the next target.

        Args:
            goal: The hand's pose, body to world; of a position only the origin is used.
            t: The present time [s].

        Raises:
            NonFiniteError: If it contains NaN or inf.
        """
        if not np.isfinite(goal.homogeneous).all():
            raise NonFiniteError(f"the target contains NaN or inf at t = {t:.6g} s")
        rotation = pin.Quaternion(goal.rotation).normalized().toRotationMatrix()
        point = goal.translation
        if self._streams:
            pose = pin.SE3(rotation, point)
            target = point[self._indices] if self.axes else pose
            self.compensated.controller.stream("hand").send(target, t=t)
            return
        self._point.aim(point[self._indices] if self.axes else point)
        self._rotation.aim(rotation)

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the effort to hold from t on for a period [s].

        It is clipped to the motors' limits.

        Raises:
            HspControlError: See `CompensatedController.effort`.
        """
        wanted = self.compensated.effort(t, q, v, period)
        effort = np.clip(wanted, -self._strongest, self._strongest)
        if (effort != wanted).any():
            self.compensated.applied(effort, period)
        self._expected, self._period = t + period, period
        return effort

    def pose(self, q: Array) -> pin.SE3:
        """Return the hand's pose in a configuration, body to world."""
        state = self.robot.state(0.0, q, np.zeros(self.robot.nv))
        frame = state.frame(self.frame)
        return pin.SE3(frame.rotation, frame.position)

    def _task(self, gains: Gains, stream: StreamPose | None) -> Task:
        """Return the hand's task, which follows the targets of `aim`."""
        if self.axes is not None:
            point: HeldPoint | Stream = self._point
            if stream is not None:
                point = _linear(stream)
            return FramePosition(
                self.frame, point, gains=gains, axes=self.axes, name="hand"
            )
        if stream is not None:
            return FramePose(self.frame, stream, gains=gains, name="hand")
        held = ComposedPose(self._point, self._rotation)
        return FramePose(self.frame, held, gains=gains, name="hand")


def _linear(stream: StreamPose) -> Stream:
    """Return the stream of a point with the linear bounds of a pose's."""
    known = {field.name for field in fields(cast(Any, Stream))}
    settings = stream.changed_fields()
    return Stream(**{name: settings[name] for name in settings if name in known})
