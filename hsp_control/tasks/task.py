"""The abstract task: error, Jacobian and desired acceleration."""

import re
from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, replace
from typing import Any, ClassVar, Literal, Self

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import TaskError
from hsp_control.declaration import Part, within
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import PositiveCount
from hsp_control.engine.plans import PartCall, PartCalls, implemented_by
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.feedback import (
    UNBOUNDED,
    ErrorPart,
    Feedback,
    FeedbackInForce,
    LargestError,
    largest_errors,
)
from hsp_control.tasks.gains import Gains
from hsp_control.trajectories import Schedule
from hsp_control.trajectories.crossfade import AnyReference
from hsp_control.trajectories.streams.followed import FollowedStream

Drawn = Literal["position", "orientation", "direction"]
"""Quantities that can be drawn in the world; see `Task`."""


class Task(Part, ABC, family="tasks", error=TaskError):
    """e'' + Kv e' + Kp e + offset = 0: a task with an exactly linear error equation.

    A subclass declares its parameters as fields (see `Part`) and implements:

    * `error_parts` names the components of e, and so gives the number of rows.
    * `call` returns a kind of call that writes J, J', e, e' and a_x; or `evaluate`
    * writes them in plain Python. The error equation must follow *exactly* from
      J a + J'v = a_x, in the coordinates of e.
    * `reference_rate` returns J v on the reference.
    * `measure` returns the reference and the actual value, for logs and plots.
    * `placed`, if it refers to the start or to frames.

    The task chooses the frame and units of its m rows; J, J' and a_x use the same.
    J acts on the tangent space: v and a have shape (nv,), as in Pinocchio. The
    coordinates of e, e' and offset may be others, in which the error equation is linear
    (a rotation vector, for example).

    A task has no memory: the controller owns the feedback, and the state stores the
    buffers of a computation (see `RobotState.cached`).

    Most tasks derive from `SecondOrderTask`, which has gains.

    Attributes:
        order: Order of the error equation.
        drawn: The results of `measure`, in this order, if they can be drawn in the
            world: ``position`` [m], along `axes` if the task has those, ``orientation``
            as a quaternion (x, y, z, w), ``direction`` as a unit vector.
    """

    order: ClassVar[Literal[1, 2]] = 2
    drawn: ClassVar[tuple[Drawn, ...]] = ()
    yaml_key: ClassVar[str | None] = "name"

    _: KW_ONLY
    priority: PositiveCount | None = None
    """Priority [-]; 1 is the highest, and tasks of the same priority form one level. By
    default 1; on a floating base 1 for tasks that keep the balance (centre of mass,
    angular momentum, the trunk) and 2 for all others."""
    schedule: Schedule | None = None
    """Schedule in which the task is active [-]; always by default."""
    name: str = ""
    """The task's name in the log [-]; by default that of its frame, or its type."""

    def _complete(self) -> None:
        if not self.name:
            self._set_default("name", self._default_name())
        if not self.name.replace("_", "").replace("-", "").isalnum():
            raise TaskError(
                f"task name {self.name!r}: use letters, digits, '_' and '-' (the "
                "columns of the log contain it)"
            )

    def _default_name(self) -> str:
        return self.yaml_type or default_name(type(self).__name__)

    def changed_fields(self) -> dict[str, Any]:
        """Return the fields that are not their defaults, by name."""
        changed = super().changed_fields()
        if self.name == self._default_name():
            changed.pop("name", None)
        return changed

    @property
    @abstractmethod
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The components of e, in the order of the rows."""

    @property
    def rows(self) -> int:
        """Number of rows m."""
        return sum(part.size for part in self.error_parts)

    def part_ends(self) -> Indices:
        """Return the ends of the parts of the error, shape (parts,)."""
        return np.cumsum([part.size for part in self.error_parts])

    @abstractmethod
    def feedback(self) -> Feedback:
        """Return new arrays of feedback with the task's own gains, and no offset.

        Raises:
            GainError: If the gains do not fit the rows, or the error would not decay.
        """

    def in_force(self) -> FeedbackInForce:
        """Return new arrays of the task's own feedback, for a run."""
        own = self.feedback()
        numbers = np.stack([own.Kp, own.Kv])
        feedback = own._replace(Kp=numbers[0], Kv=numbers[1])
        return FeedbackInForce(numbers, feedback, np.zeros((0, 0)))

    def calls_in_force(
        self, state: RobotState, in_force: FeedbackInForce, out: TaskSample
    ) -> PartCalls:
        """Return the calls with a feedback that may change; see `calls`."""
        return self.calls(state, in_force.feedback, out)

    def feedback_at(self, state: RobotState) -> Feedback:
        """Return new arrays of the task's own feedback at a state, without offset."""
        return self.feedback()

    def linear_feedback(self, state: RobotState, in_force: FeedbackInForce) -> Feedback:
        """Return the feedback for small errors at a state, for the rate check."""
        return in_force.feedback

    def fed_back(self, feedback: Feedback, error: Array, error_rate: Array) -> Array:
        """Return the feedback of the error equation e'' = -fed_back.

        By default Kv e' + Kp s(e) + offset; of a task of first order K e + offset, and
        the equation is e' = -fed_back. A task of your own with another feedback, which
        need not be linear, overrides this, and adds the result to a_x in
        `evaluate`; the first step checks that its equation follows. Near e = 0 it
        should be that of the gains, which the check of the control period
        uses.

        Args:
            feedback: The gains and the offset.
            error: e, shape (m,) [m or rad].
            error_rate: e', shape (m,) [m/s or rad/s].

        Returns:
            A new array, shape (m,) [m/s² or rad/s²].
        """
        if self.order == 1:
            return np.asarray(feedback.Kp @ error + feedback.offset)
        return feedback.acceleration(error, error_rate)

    def placed(self, start: Start) -> Self:
        """Return the task for a robot and a start, checked.

        Values that are relative to the start, and omitted ones that the robot defines,
        are replaced by numbers and names. A subclass ends with ``return
        replaced.checked(start.state.robot)``.

        Raises:
            HspControlError: If the task does not fit the robot; the message contains
                the field.
        """
        return self.checked(start.state.robot)

    def checked(self, robot: Robot) -> Self:
        """Return the task itself, whose rows and gains fit each other and the robot.

        Raises:
            TaskError: If the task has more rows than the robot has degrees of freedom.
            GainError: If the gains do not fit the rows, or the error would not decay.
        """
        if self.rows > robot.nv:
            raise TaskError(
                f"the task has {self.rows} rows; {robot.name} has {robot.nv} degrees "
                "of freedom"
            )
        self.feedback()
        return self

    def _not_placed(self, what: str) -> TaskError:
        """Return the error of a task that is used before it is placed."""
        return TaskError(
            f"task {self.name!r}: a controller would look up its {what}; outside of "
            "one, call `placed` first"
        )

    @property
    def followed(self) -> AnyReference | None:
        """The trajectory that a placed task follows, its field; None if it has none."""
        trajectory: AnyReference | None = getattr(self, "trajectory", None)
        return trajectory

    @property
    def remembers(self) -> bool:
        """Whether it follows a stream, whose targets are messages."""
        return any(True for _ in parts_within(self, FollowedStream))

    def following(self, trajectory: AnyReference) -> Self:
        """Return the task with another trajectory.

        Raises:
            TaskError: If it follows none.
        """
        if self.followed is None:
            raise TaskError(f"task {self.name!r} follows no trajectory")
        changes: dict[str, Any] = {"trajectory": trajectory}  # checked there
        return replace(self, **changes)

    def keeps_balance(self, robot: Robot) -> bool:
        """Whether a floating base needs the task for its balance; see `priority`."""
        return False

    def call(self, state: RobotState) -> PartCall:
        """Return a kind of call with its arguments, without ``feedback`` and ``out``.

        With these two, a `Feedback` and a `TaskSample`, it computes the same sample as
        `evaluate`. Arguments are numbers, arrays and records of them, which may be
        memory of the state; and values that are updated before every call:
        ``state.frame(name)`` becomes a `FrameMotion`, a trajectory its sample.

        Args:
            state: The state that every step reads. Its values change between steps.
        """
        raise TypeError(f"{type(self).__name__} implements neither call nor evaluate")

    def calls(
        self, state: RobotState, feedback: Feedback, out: TaskSample
    ) -> PartCalls:
        """Return the calls that write the sample in a step."""
        if implemented_by(self, "call", "evaluate") == "call":
            return [self.call(state).given(feedback=feedback, out=out)]
        seen = state.read_only
        return [PartCall(self.evaluate, state=seen, out=out, feedback=feedback)]

    def evaluate(
        self,
        state: RobotState,
        out: TaskSample | None = None,
        feedback: Feedback | None = None,
    ) -> TaskSample:
        """Return J, J', e, e' and a_x at a state.

        Start an implementation with ``out, feedback = self.given(state, out,
        feedback)``, write every entry of the five arrays, and return ``out``.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            out: The sample to write into; None: a new one.
            feedback: The gains and the offset; None: the task's own gains.

        Returns:
            ``out``, or the new sample.
        """
        out, feedback = self.given(state, out, feedback)

        def make() -> tuple[tuple[Feedback, TaskSample], PartCalls]:
            own = self.feedback()
            sample = TaskSample.allocate(self.rows, state.robot.nv)
            call = self.call(state).given(feedback=own, out=sample)
            return (own, sample), [call]

        (own, sample), run = state.prepared(self, "evaluate", make)
        for array, value in zip(own, feedback, strict=True):
            array[:] = value
        run()
        for array, value in zip(out, sample, strict=True):
            array[:] = value
        return out

    def given(
        self, state: RobotState, out: TaskSample | None, feedback: Feedback | None
    ) -> tuple[TaskSample, Feedback]:
        """Return both, or new ones where they are None.

        Raises:
            TaskError: If ``out`` is no sample of so many rows.
        """
        shape = self.rows, state.robot.nv
        if out is not None and (
            not isinstance(out, TaskSample) or out.jacobian.shape != shape
        ):
            kind = type(out).__name__
            if isinstance(out, TaskSample):
                kind = f"a TaskSample of shape {out.jacobian.shape}"
            raise TaskError(
                f"task {self.name!r}: out is {kind}; needs TaskSample.allocate{shape}"
            )
        return (
            TaskSample.allocate(self.rows, state.robot.nv) if out is None else out,
            self.feedback_at(state) if feedback is None else feedback,
        )

    @abstractmethod
    def reference_rate(self, state: RobotState) -> Array:
        """Return J v of a robot that tracks its reference exactly, shape (m,).

        In the rows and units of J v. Friction feed-forward uses it, for example.
        """

    @abstractmethod
    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return (reference, actual) for logs and plots, two arrays of one shape (k,).

        Choose coordinates that are easy to read, for example a quaternion; k need not
        be m. `drawn` names them.
        """


class SecondOrderTask(Task):
    """A task with gains: e'' + Kv e' + Kp s(e) + offset = 0.

    s(e) = e as long as no part of the error is longer than its `largest_error`.
    """

    _: KW_ONLY
    gains: Gains = Gains(natural_frequency=10.0)
    """Kp and Kv of the rows [1/s², 1/s]; critically damped at 10 rad/s by default."""
    largest_error: LargestError = "robot"
    """Error beyond which the feedback does not grow, so that the command for a target
    far away, or out of reach, is bounded [m or rad]. One number, or one per part
    of the error; "none": no bound, and near a singularity the paper's law down to the
    controller's threshold. By default 0.35 of the robot's size for a position
    (`Robot.size`), 1.25 rad for an orientation, and none for joints."""

    def feedback(self) -> Feedback:
        """Return new arrays of feedback; see `Task.feedback`."""
        rows = self.rows
        with within("gains"):
            Kp, Kv = self.gains.matrices(rows)
        return Feedback(Kp, Kv, np.zeros(rows), self._largest())

    def checked(self, robot: Robot) -> Self:
        """Return the task with its largest errors in numbers; see `Task.checked`."""
        with within("largest_error"):
            largest = largest_errors(self.largest_error, self.error_parts, robot)
        changes: dict[str, Any] = {"largest_error": largest}
        placed = replace(self, **changes)
        return super(SecondOrderTask, placed).checked(robot)

    def _largest(self) -> Array:
        """Return `Feedback.largest`; a task that is not placed has no bound."""
        if self.largest_error is None or isinstance(self.largest_error, str):
            return UNBOUNDED
        found, first = [], 0
        numbers: Any = self.largest_error
        for part, length in zip(self.error_parts, numbers, strict=True):
            if length is not None:
                found.append((first, first + part.size, length))
            first += part.size
        return np.array(found).reshape(-1, 3)


def default_name(frame: str) -> str:
    """Return a frame's name as a task name: other characters become ``_``."""
    return re.sub("[^0-9A-Za-z_-]", "_", frame)
