"""Commands of a running controller: changes, targets and velocities."""

from abc import abstractmethod
from contextlib import suppress
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.errors import ControllerError
from hsp_control.common.warned import warn
from hsp_control.control.changes import Change, Changes
from hsp_control.control.composition import Composition
from hsp_control.control.declared_rates import check_rates
from hsp_control.control.first_state import warn_of_far_target
from hsp_control.control.gains_in_force import check_held
from hsp_control.control.stream_handle import StreamHandle
from hsp_control.control.targets import (
    RAMP,
    followed_stream,
    listened_to,
    new_stream,
    target_of,
)
from hsp_control.declaration.language import check_kind
from hsp_control.tasks import Task
from hsp_control.trajectories.crossfade import settled
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.message import Axes
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed

_REHEARSALS = 5
"""Rehearsed steps per change: the first fills the processor's caches, the others train
branch prediction."""


class Commanded(Composition):
    """A composition that accepts changes and targets at run time."""

    def at(self, t: float) -> Changes:
        """Return an object that makes changes which begin at a time [s].

        ``controller.at(2.0).ramp(0.5).gains("hand", hsp.Gains(natural_frequency=20))``.
        Changes apply in the order of their times, whatever the order of the calls; each
        continues from the values then in force, so that several may overlap, and tau
        stays continuous. A time that has passed means now, with the whole ramp.
        """
        return Changes(self.change, t)

    def set_target(self, task: str, target: ArrayLike | pin.SE3) -> StreamHandle:
        """Move a task to a target from now on, smoothly, until the next one is set.

        ``controller.set_target("hand", pose)``, at any time and as often as needed. A
        stream takes over from the task's trajectory, with a crossfade, and goes there
        as fast as it may: at 0.5 m/s and 3 m/s², 1.5 rad/s and 8 rad/s². A task that
        was given a stream, with its own bounds, continues with that, unless it listens
        to a source: then this one takes over, and says so.
        ``controller.at(t).reference(task, trajectory)`` ends it.

        Args:
            task: Name of the task.
            target: For a pose a pin.SE3, x, y, z and a quaternion (x, y, z, w), or a
                matrix; for an orientation a quaternion or a matrix; for a pointing task
                also a direction, three numbers; else the numbers of the task's
                trajectory [m, or the task's unit].

        Returns:
            The task's stream; see `stream`.

        Raises:
            ControllerError: If there is no such task, it follows no trajectory, or the
                target is of another kind.
            StreamError: If the target is not valid.
        """
        followed = self._followed(task)
        value = target_of(followed, target, lambda: self._here().state)
        # otherwise it is in reach
        if not np.abs(value).max() < self._declared.robot.size:
            warn_of_far_target(self._here().state, followed, value)
        return self._sent(task, value=value)

    def stream(self, of: str | Streamed) -> StreamHandle:
        """Return the handle of a stream: ``controller.stream("hand").send(pose)``.

        Args:
            of: The name of a task: the stream is the one that it follows after the
                changes that have begun, or else after all of them. Or a stream that was
                given to the controller, for an obstacle, for example, or for the
                position of a pose.

        Raises:
            ControllerError: If there is no such task, or it follows no stream, or
                nothing follows the given one.
        """
        place = ("tasks", of) if isinstance(of, str) else ()
        return StreamHandle(lambda: self._run_of(of), self._on_message, place)

    def _on_message(self) -> None:
        """Prepare the step that takes a message.

        Unless the steps are those of another thread: it would have to wait, and its
        processor's caches are others.
        """
        self._memory.motion.look_again()
        if self._memory.begun and self._lock.was_mine:
            with self._lock:
                self._rehearse(1)

    def _run_of(self, of: str | Streamed) -> StreamRun:
        """Return the stream of a task, or of a declaration, in the present run."""
        if isinstance(of, Streamed):
            for run in reversed(self._memory.streams):
                if run.declared is of:
                    return run
            raise ControllerError(
                f"nothing of this controller follows this {type(of).__name__}: give it "
                "to a task, or to controller.at(t)"
            )
        followed: object = settled(self._followed(of).followed, np.inf)
        if isinstance(followed, FollowedStream):
            return followed.run
        with suppress(ControllerError):  # it may be there no more
            at_last: object = settled(self._followed(of, at_last=True).followed, np.inf)
            if isinstance(at_last, FollowedStream):
                return at_last.run
        raise ControllerError(
            f"task {of!r} follows no stream, but {type(followed).__name__}; give it "
            "one, such as StreamPose(), or set_target"
        )

    def set_velocity(
        self, task: str, velocity: ArrayLike, axes: Axes = "world"
    ) -> StreamHandle:
        """Move a task at a velocity from now on, as with a joystick.

        ``controller.set_velocity("hand", twist, axes="tool")``, again and again: if no
        other velocity or target comes for 0.2 s, it fades to zero. The reference is its
        integral. As with `set_target`, a stream takes over from the task's trajectory;
        a task that was given a stream goes on with that, and its ``dead_man``.

        Args:
            task: Name of the task.
            velocity: For a pose the linear velocity and the angular one, shape (6,)
                [m/s, rad/s]; for an orientation or a direction the angular one, (3,);
                else those of the coordinates of the task's trajectory.
            axes: ``world``, in a relative task those of its reference, or ``tool``,
                the axes of the moving body.

        Returns:
            The task's stream; see `stream`.

        Raises:
            ControllerError: If there is no such task, or it follows no trajectory.
            StreamError: If the velocity is not valid.
        """
        return self._sent(task, velocity=velocity, axes=axes)

    @abstractmethod
    def _rehearse(self, times: int) -> None:
        """Run the next step's calls once at the present state, without effect."""

    def _sent(self, task: str, **message: Any) -> StreamHandle:
        """Send a message to a task's stream, which takes over if there is none yet."""
        present = self._followed(task)
        if followed_stream(present) is None:
            reference: Any = new_stream(present.followed)
            reference.check(getattr(present.followed, "dimension", None), **message)
            self.at(self._state.t).ramp(RAMP).reference(task, reference)
            if source := listened_to(present):
                warn(
                    f"task {task!r} follows {source} no longer: a command takes over; "
                    f"controller.at(t).reference({task!r}, stream) returns to it",
                    UserWarning,
                )
        stream = self.stream(task)
        stream.send(**message)
        return stream

    def _followed(self, task: str, *, at_last: bool = False) -> Task:
        """Return a task that follows a trajectory; ``at_last``: after all changes."""
        present = (self.setup.task(task) if at_last else self._task_now(task)).task
        if present.followed is None:
            raise ControllerError(f"task {task!r} follows no trajectory")
        return present

    def change(self, change: Change) -> None:
        """Make a change; `at` is the shorter way.

        Raises:
            ControllerError: If it names something that does not exist at its time.
            UnstableRateError: If gains that follow make the running loop unstable at
                its period, without delays, where the robot is now.
            RateError: If a user-defined rate of a new part is wrong.
            HspControlError: If its parts do not fit the robot.
        """
        check_kind("change is", change, Change, ControllerError)
        with self._lock:
            self._change(change)
            if self._memory.begun:  # when the objects of the change are freed
                self._rehearse(_REHEARSALS)

    def _change(self, change: Change) -> None:
        here, now, given = None, self._in_force.latest, change
        begun = self._memory.begun
        self._memory.clock.change(change.at, max(now, 0.0))
        self._memory.motion.look_again()
        if begun:
            change = replace(change, at=max(change.at, now))
            here = self._here()
        known = self._in_force.kept
        time_line = known.with_change(change, here)
        if period := self._memory.sent.period:
            state = (here or time_line.start).state
            check_held(self.setup, time_line.setup, state, period)
        if begun:
            check_rates(time_line.setup, self.setup, self._state)
        self._in_force.go_over_to(time_line)
        if begun:
            self._memory.made(now, given)
