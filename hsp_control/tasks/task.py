"""The abstract task: error, Jacobian and desired acceleration."""

import re
from abc import ABC, abstractmethod
from functools import cached_property, partial
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.common.identity_cache import IdentityCache, without_caches
from hsp_control.common.kernels import kernel
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains


class TaskSample(NamedTuple):
    """J a + J'v = a_x: the rows of a task at one state.

    Units are given for positions and orientations; other tasks have their own.

    Attributes:
        jacobian: Task Jacobian J, shape (m, nv).
        jacobian_dot: Its time derivative J', shape (m, nv).
        error: e, reference minus actual, in the error coordinates of the task, shape
            (m,) [m or rad].
        error_rate: e', shape (m,) [m/s or rad/s].
        acceleration: Desired acceleration a_x, with which
            e'' + Kv e' + Kp e + offset = 0, in the frame of J's rows, shape (m,)
            [m/s² or rad/s²].
    """

    jacobian: Array
    jacobian_dot: Array
    error: Array
    error_rate: Array
    acceleration: Array

    @classmethod
    def allocate(cls, rows: int, nv: int) -> "TaskSample":
        """Return a sample of zeros with m = ``rows``."""
        return cls(
            np.zeros((rows, nv)),
            np.zeros((rows, nv)),
            np.zeros(rows),
            np.zeros(rows),
            np.zeros(rows),
        )

    def rows(self, start: int, stop: int) -> "TaskSample":
        """Return the rows from ``start`` to ``stop`` - 1, as views of this memory."""
        return TaskSample(*(array[start:stop] for array in self))


class Feedback(NamedTuple):
    """Kv e' + Kp e + offset: a task's feedback, as one argument of a kernel.

    Attributes:
        Kp: Position gain, shape (m, m) [1/s²].
        Kv: Velocity gain, shape (m, m) [1/s].
        offset: Added acceleration, shape (m,), see `Task`.
    """

    Kp: Array
    Kv: Array
    offset: Array


class Task(ABC):
    """e'' + Kv e' + Kp e + offset = 0: a task with an exactly linear error equation.

    A subclass calls ``super().__init__`` and implements three methods:

    * `evaluate` writes J, J', e, e' and a_x. The error equation must follow *exactly*
      from J a + J'v = a_x, in the coordinates of e.
    * `reference_rate` returns J v on the reference.
    * `measure` returns the reference and the actual value, for logs and plots.

    The task chooses the frame and units of its m rows; J, J' and a_x use the same.
    J acts on the tangent space: v and a have shape (nv,), as in Pinocchio. The
    coordinates of e, e' and offset may be others, in which the error equation is linear
    (a rotation vector, for example).

    A subclass may override `compile` to make a step faster. The default calls
    `evaluate` at every step. `CompiledTask` is the base class for tasks that compile.

    Attributes:
        robot: The robot.
        name: Name of the task in the log.
        rows: Number of rows m.
        Kp: Stiffness, shape (m, m) [1/s²]. Compiled steps read this array: change it
            in place.
        Kv: Damping, shape (m, m) [1/s]. Change it in place.
        offset: Additional term of the error equation, shape (m,) [m/s² or rad/s²].
            Zero, unless a compensator such as integral action writes it. Change it in
            place.
    """

    def __init__(self, robot: Robot, rows: int, gains: Gains, name: str) -> None:
        """Check the arguments and store them.

        Args:
            robot: The robot.
            rows: Number of rows m, at most nv.
            gains: Feedback gains of the m rows.
            name: Name of the task in the log: letters, digits, ``_`` and ``-``.

        Raises:
            GainError: If the gains do not fit the rows, or the error would not decay.
            TaskError: If the task has more rows than the robot has degrees of freedom,
                or the name has other characters.
        """
        if rows > robot.nv:
            raise TaskError(
                f"task {name!r} has {rows} rows; {robot.name} has {robot.nv} degrees "
                "of freedom"
            )
        if not name or not name.replace("_", "").replace("-", "").isalnum():
            raise TaskError(
                f"task name {name!r}: use letters, digits, '_' and '-' (the columns of "
                "the log contain it)"
            )
        self.robot = robot
        self.name = name
        self.rows = rows
        self.Kp, self.Kv = gains.matrices(rows)
        self.offset: Array = np.zeros(rows)

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Reset `compile` if a subclass overrides `evaluate` only.

        Otherwise a subclass of a compiled task would inherit a step plan that ignores
        its `evaluate`.
        """
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = Task.compile  # type: ignore[method-assign]

    def compile(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return the step plan that does what `evaluate` does; may be overridden.

        Args:
            state: The state that every step reads. Its values change between steps.
            out: The sample that every step writes.
        """
        return StepPlan(write=(partial(self.evaluate, state, out),))

    @abstractmethod
    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return J, J', e, e' and a_x at a state.

        Start an implementation with ``out = self._out(out)``, write every entry of the
        five arrays, and return ``out``.

        Args:
            state: The robot's state: t, q, v and the kinematics.
            out: The sample to write into; None: a new one.

        Returns:
            ``out``, or the new sample.
        """

    @abstractmethod
    def reference_rate(self, state: RobotState) -> Array:
        """Return J v of a robot that is on its reference and stays there, shape (m,).

        In the rows and units of J v. Friction feed-forward uses it, for example.
        """

    @abstractmethod
    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return (reference, actual) for logs and plots, two arrays of one shape (k,).

        Choose coordinates that are easy to read, for example a quaternion; k need not
        be m.
        """

    @property
    def feedback(self) -> Feedback:
        """The gains and the offset, for kernels."""
        return Feedback(self.Kp, self.Kv, self.offset)

    def _out(self, out: TaskSample | None) -> TaskSample:
        """Return ``out``, or a new sample if it is None."""
        return TaskSample.allocate(self.rows, self.robot.nv) if out is None else out


class CompiledTask(Task):
    """A task that compiles its step plan once and runs it at every step.

    A subclass implements `_step_plan` instead of `evaluate`; `reference_rate` and
    `measure` as for `Task`.
    """

    def __init__(self, robot: Robot, rows: int, gains: Gains, name: str) -> None:
        """Check the arguments and store them; see `Task`."""
        super().__init__(robot, rows, gains, name)

    @abstractmethod
    def _step_plan(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return the calls that write ``out``.

        The calls read the state each time that they run; see `Task.compile`.
        """

    def compile(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return the step plan that does what `evaluate` does; see `Task.compile`."""
        return self._step_plan(state, out)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return J, J', e, e' and a_x at a state; see `Task.evaluate`."""
        if out is None:
            out = TaskSample.allocate(self.rows, self.robot.nv)
        plan = self._compiled.get(state, out)
        for follow in plan.follow:
            follow(state.t)
        for write in plan.write:
            write()
        return out

    @cached_property
    def _compiled(self) -> IdentityCache[StepPlan]:
        return IdentityCache(self._step_plan)

    def __getstate__(self) -> dict[str, Any]:
        return without_caches(self)


def default_name(frame: str) -> str:
    """Return a frame's name as a task name: other characters become ``_``."""
    return re.sub("[^0-9A-Za-z_-]", "_", frame)


@kernel
def copy_rows(
    J_frame: Array, J_frame_dot: Array, first: int, J: Array, J_dot: Array
) -> None:
    """Write J and J': rows ``first``, ``first`` + 1, ... of the frame's."""
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            J[i, j] = J_frame[first + i, j]
            J_dot[i, j] = J_frame_dot[first + i, j]


@kernel
def add_feedback(
    feed_forward: Array,
    feedback: Feedback,
    e: Array,
    e_dot: Array,
    out: Array,
) -> None:
    """Write feed_forward + offset + Kv e' + Kp e; ``out`` may be ``feed_forward``."""
    Kp, Kv, offset = feedback
    for i in range(e.shape[0]):
        total = feed_forward[i] + offset[i]
        for j in range(e.shape[0]):
            total += Kv[i, j] * e_dot[j] + Kp[i, j] * e[j]
        out[i] = total
