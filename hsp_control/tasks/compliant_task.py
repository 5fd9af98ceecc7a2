"""The base class of tasks that may have an impedance instead of gains."""

from dataclasses import KW_ONLY, replace
from typing import ClassVar, NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError
from hsp_control.declaration import within
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.law import TaskSample
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks.feedback import Feedback, FeedbackInForce
from hsp_control.tasks.gains import Gains
from hsp_control.tasks.impedance import Impedance, parts_of
from hsp_control.tasks.task import SecondOrderTask, Task

_NO_GAINS = Gains(natural_frequency=10.0)
_THRESHOLD = 0.03  # default threshold of the law's singularities: see `Controller`


class Rotating(NamedTuple):
    """The rows of an error that are a rotation vector, and the rotating frame."""

    first: int  # the first of the three rows; the number of rows if there are none
    rotation: Array  # world ← frame, (3, 3)
    angular_velocity: Array  # of the frame, in world axes, (3,) [rad/s]


class CompliantTask(SecondOrderTask):
    """A task with gains, or with an impedance: then it yields to a force like a spring.

    An impedance is a set of gains that depend on the state. A step evaluates the task,
    computes them from its J, J', e and e', and evaluates it again with them: so there
    is a single error equation. A subclass whose error contains a rotation vector
    overrides `_rotating`.

    Attributes:
        wrench_unit: The unit of a force along the rows of J, if these are axes of the
        world: an estimated force is then logged.
    """

    wrench_unit: ClassVar[str | None] = None

    _: KW_ONLY
    impedance: Impedance | None = None
    """Stiffness and damping of the rows [N/m and N·s/m, or N·m/rad and N·m·s/rad],
    instead of `gains`; none by default. Its spring has a largest force, and fades in
    directions without mobility: `largest_error` is ignored."""

    def __post_init__(self) -> None:
        """Check that there are not both gains and an impedance."""
        if self.impedance is not None and self.gains != _NO_GAINS:
            raise GainError(
                "give either gains [1/s², 1/s] or impedance [N/m, N·s/m], not both"
            )

    def _rotating(self, state: RobotState) -> Rotating:
        """Return the rows that are a rotation vector; by default none."""
        return Rotating(self.rows, np.eye(3), np.zeros(3))

    def checked(self, robot: Robot) -> Self:
        """Return the task with its largest force in numbers; see `Task.checked`."""
        if self.impedance is None:
            return super().checked(robot)
        with within("impedance"):
            if robot.unactuated:
                raise GainError(
                    f"{robot.name} has a free-flyer root: its inertia at a task "
                    "depends on the contacts; needs a robot with a fixed base"
                )
            impedance = self.impedance.placed(self.error_parts, robot)
        placed = replace(self, impedance=impedance)
        return super(CompliantTask, placed).checked(robot)

    def feedback(self) -> Feedback:
        """Return new arrays of feedback; zeros with an impedance, see `feedback_at`."""
        if self.impedance is None:
            return super().feedback()
        rows = self.rows
        with within("impedance"):
            self.impedance.numbers(self.error_parts)
        zeros = np.zeros((2, rows, rows))
        return Feedback(zeros[0], zeros[1], np.zeros(rows))

    def in_force(self) -> FeedbackInForce:
        """Return new arrays of the task's own feedback; see `Task.in_force`."""
        if self.impedance is None:
            return super().in_force()
        mobility = np.zeros((self.rows, self.rows))
        numbers = self.impedance.numbers(self.error_parts)
        return FeedbackInForce(numbers, self.feedback(), mobility)

    def calls_in_force(
        self, state: RobotState, in_force: FeedbackInForce, out: TaskSample
    ) -> PartCalls:
        """Return the calls: the task, its gains, the task with these gains."""
        task = self.calls(state, in_force.feedback, out)
        if self.impedance is None:
            return task
        gains = PartCall(
            engine.ImpedanceGains,
            M=state.inertia,
            M_dot=state.inertia_rate,
            rotating=self._rotating(state),
            impedance=parts_of(in_force.numbers),
            ends=self.part_ends(),
            sample=out,
            threshold=_THRESHOLD,
            G=in_force.mobility,
            Kp=in_force.feedback.Kp,
            Kv=in_force.feedback.Kv,
        )
        return [*task, gains, *task]

    def feedback_at(self, state: RobotState) -> Feedback:
        """Return new arrays of feedback at a state; see `Task.feedback_at`."""
        if self.impedance is None:
            return super().feedback_at(state)
        return self._at(state, self.in_force().numbers)

    def linear_feedback(self, state: RobotState, in_force: FeedbackInForce) -> Feedback:
        """Return the feedback for small errors: no spring is at its largest force."""
        if self.impedance is None:
            return super().linear_feedback(state, in_force)
        numbers = in_force.numbers.copy()
        parts_of(numbers)[3][:] = 0.0
        return self._at(state, numbers)

    def _at(self, state: RobotState, numbers: Array) -> Feedback:
        """Return Kp and Kv of an impedance at a state."""

        def make() -> tuple[FeedbackInForce, PartCalls]:
            mobility = np.zeros((self.rows, self.rows))
            in_force = FeedbackInForce(
                np.zeros_like(numbers), self.feedback(), mobility
            )
            sample = TaskSample.allocate(self.rows, state.robot.nv)
            return in_force, self.calls_in_force(state, in_force, sample)

        in_force, run = state.prepared(self, "impedance", make)
        in_force.numbers[:] = numbers
        run()
        return Feedback(*(array.copy() for array in in_force.feedback))


def impedance_of(task: Task) -> Impedance | None:
    """Return the impedance of a task; None if it has gains."""
    return task.impedance if isinstance(task, CompliantTask) else None
