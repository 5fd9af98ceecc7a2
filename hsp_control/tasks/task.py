"""What a task is: rows of J, their rates, and the acceleration that tracks exactly."""

import re
from abc import ABC, abstractmethod
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TaskError
from hsp_control.common.kernels import kernel
from hsp_control.common.step_plan import StepPlan
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.gains import Gains


class TaskSample(NamedTuple):
    """A task at one state; the law wants J a + J'v = a_x.

    Attributes:
        jacobian: J, shape (m, nv).
        jacobian_dot: J', shape (m, nv).
        error: e in the task's own coordinates, desired minus actual, shape (m,).
        error_rate: e', shape (m,).
        acceleration: a_x, which makes e'' + Kv e' + Kp e = 0, shape (m,).
    """

    jacobian: Array
    jacobian_dot: Array
    error: Array
    error_rate: Array
    acceleration: Array

    @classmethod
    def allocate(cls, rows: int, nv: int) -> "TaskSample":
        """Return a sample of zeros."""
        return cls(
            np.zeros((rows, nv)),
            np.zeros((rows, nv)),
            np.zeros(rows),
            np.zeros(rows),
            np.zeros(rows),
        )

    def rows(self, start: int, stop: int) -> "TaskSample":
        """Return the sample of some rows, sharing memory."""
        return TaskSample(*(array[start:stop] for array in self))


class Task(ABC):
    """Something that the robot shall track, with an exactly linear error equation.

    To implement one: call ``super().__init__``, and write `evaluate`, which fills every
    array of ``out`` such that e'' + Kv e' + Kp e + offset = 0 follows *exactly* from
    J a + J'v = a_x in the error coordinates that it reports, `reference_rate` and
    `measure`.

    Attributes:
        robot: The robot.
        name: What the log calls it.
        rows: Number of rows m.
        Kp: Stiffness, shape (m, m) [1/s²].
        Kv: Damping, shape (m, m) [1/s].
        offset: What the error equation has besides, shape (m,) [m/s² or rad/s²]:
            e'' + Kv e' + Kp e + offset = 0. Zero, unless something that remembers
            writes it, as integral action does.
    """

    def __init__(self, robot: Robot, rows: int, gains: Gains, name: str) -> None:
        """Check the gains against the rows and keep them.

        Raises:
            GainError: If the gains do not fit the rows or do not decay.
            TaskError: If the task has more rows than the robot has freedoms.
        """
        if rows > robot.nv:
            raise TaskError(
                f"task {name!r} has {rows} rows; {robot.name} has {robot.nv} freedoms"
            )
        if not name or not name.replace("_", "").replace("-", "").isalnum():
            raise TaskError(
                f"task name {name!r}: use letters, digits, '_' and '-' (it names the "
                "log's columns)"
            )
        self.robot = robot
        self.name = name
        self.rows = rows
        self.Kp, self.Kv = gains.matrices(rows)
        self.offset: Array = np.zeros(rows)

    def __init_subclass__(cls, **arguments: Any) -> None:
        """Let an `evaluate` that is overridden count, also of a ready task."""
        super().__init_subclass__(**arguments)
        if "evaluate" in vars(cls) and "compile" not in vars(cls):
            cls.compile = Task.compile  # type: ignore[method-assign]

    def compile(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return what `evaluate` does with this state and this sample."""
        return StepPlan(write=(partial(self.evaluate, state, out),))

    @abstractmethod
    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return J, J', e, e' and a_x at a state.

        Args:
            state: The robot's state.
            out: Where to write; None: a new sample.
        """

    @abstractmethod
    def reference_rate(self, state: RobotState) -> Array:
        """Return J v of a robot on its reference and staying there, shape (m,)."""

    @abstractmethod
    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return (reference, actual) in the coordinates that a person would plot."""

    def _out(self, out: TaskSample | None) -> TaskSample:
        return TaskSample.allocate(self.rows, self.robot.nv) if out is None else out


class CompiledTask(Task):
    """A task of which `_calls` says all: calls that write a sample, decided once."""

    def __init__(self, robot: Robot, rows: int, gains: Gains, name: str) -> None:
        """Set the task; see `Task`."""
        super().__init__(robot, rows, gains, name)
        self._bound: tuple[RobotState, TaskSample, StepPlan] | None = None

    @abstractmethod
    def _calls(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return what writes a sample at whatever a state then is."""

    def compile(self, state: RobotState, out: TaskSample) -> StepPlan:
        """Return what `evaluate` does; see `Task.bind`."""
        return self._calls(state, out)

    def evaluate(self, state: RobotState, out: TaskSample | None = None) -> TaskSample:
        """Return the sample; see `Task.evaluate`."""
        if out is None:
            out = TaskSample.allocate(self.rows, self.robot.nv)
        bound = self._bound
        if bound is None or bound[0] is not state or bound[1] is not out:
            self._bound = bound = state, out, self._calls(state, out)
        for follow in bound[2].follow:
            follow(state.t)
        for write in bound[2].write:
            write()
        return out

    def __getstate__(self) -> dict[str, Any]:
        """Return all but what is bound to a state's memory."""
        return self.__dict__ | {"_bound": None}


def named_after(frame: str) -> str:
    """Return a task's name for a frame's, without what a log's column may not have."""
    return re.sub("[^0-9A-Za-z_-]", "_", frame)


@kernel
def copy_rows(
    J_frame: Array, J_frame_dot: Array, first: int, J: Array, J_dot: Array
) -> None:
    """Write J and J', which are rows of the frame's from ``first`` on."""
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            J[i, j] = J_frame[first + i, j]
            J_dot[i, j] = J_frame_dot[first + i, j]


@kernel
def track(
    feed_forward: Array,
    Kp: Array,
    Kv: Array,
    offset: Array,
    e: Array,
    e_dot: Array,
    out: Array,
) -> None:
    """Write feed_forward + offset + Kv e' + Kp e; ``out`` may be ``feed_forward``."""
    for i in range(e.shape[0]):
        total = feed_forward[i] + offset[i]
        for j in range(e.shape[0]):
            total += Kv[i, j] * e_dot[j] + Kp[i, j] * e[j]
        out[i] = total
