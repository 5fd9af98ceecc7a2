"""The parts of a controller, and those that are active at a time."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, ImmutableError
from hsp_control.common.keywords import suggesting
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.changes import Change, TimeLine
from hsp_control.control.declared import DeclaredController
from hsp_control.control.declared_rates import check_rates
from hsp_control.control.fitting import Base, check_parts
from hsp_control.control.in_force import InForce
from hsp_control.control.memory import RunMemory
from hsp_control.control.planned import PlannedTask
from hsp_control.control.setup import Setup
from hsp_control.control.step_lock import StepLock
from hsp_control.geometry.scene import Obstacle, Scene, Start
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import Feedback
from hsp_control.tasks.impedance import parts_of
from hsp_control.trajectories.streams.run import StreamRun


class Composition:
    """The parts of a controller, and those that are active at a time."""

    # whether a program writes the changing values; see `Controller.without_python`
    _without_python = False

    @suggesting
    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task],
        field: NullSpaceField | None = None,
        *,
        null_space_gain: ArrayLike = 10.0,
        metric: Metric | None = None,
        singularity_threshold: float = 0.03,
        limits: Limits | None = Limits(),
        contacts: Sequence[Contact] = (),
        base: Base | None = None,
        scene: Scene | Iterable[Obstacle] = (),
        start: ArrayLike | None = None,
        changes: Sequence[Change] = (),
    ) -> None:
        """Compose a controller.

        Args:
            robot: The robot.
            tasks: The tasks, with distinct names; without any, the arm has no weight
                and follows the field. Tasks of the same priority form one level; see
                `Task.priority`.
            field: The field g that the self-motion follows; None: `Rest`, g = 0.
            null_space_gain: K_N > 0 [1/s]: scalar, shape (nv,) or (nv, nv). Where the
                metric changes with q, a multiple of the identity.
            metric: Joint-space metric; None: the identity, or the mass matrix if a task
                has an impedance: then a push on the hand does not move the null space.
            singularity_threshold: Singular value of the stacked Jacobian (in the
                metric) below which its inverse is bounded instead of exact. For
                position tasks choose about 3 % of the arm's reach [m]. Near a
                singularity the efforts grow with the inverse cube of this value.
            limits: Limits on efforts and motion, by default those of the robot's
                URDF; None: no limits.
            contacts: The contacts that may support a robot with a free-flyer root.
            base: Actuation of the free-flyer root besides contacts. ``flying``: none;
                ``driven``: external, for example a simulator.
            scene: The obstacles that fields and limits name.
            start: The configuration that relative parts refer to, shape (nq,); None:
                that of the first `compute`.
            changes: Changes while running; see `at`.

        Raises:
            ControllerError: If tasks, field and robot do not belong together, or the
                tasks of one level have more rows than the robot has dofs.
            ContactError: If a floating base has neither contacts nor ``base``, or a
                fixed base has either.
            GainError: If K_N might not make the null-space error decay.
            HspControlError: If a part does not fit the robot; the message contains its
                key path.
        """
        check_parts("changes", changes, Change)
        law = tasks, field, null_space_gain, metric, singularity_threshold
        around = limits, contacts, base, scene, start
        self._declared = DeclaredController(robot, *law, *around)
        self._bind_to(RobotState(robot), RunMemory.of(robot.nv))
        given = self._declared.start
        q = robot.home() if given is None else given
        state = robot.state(0.0, q, np.zeros(robot.nv))
        here = Start(state, self._declared.scene, known=given is not None)
        self._compose(here, changes)

    def _bind_to(self, state: RobotState, memory: RunMemory) -> None:
        """Bind to a state and to a memory of the run."""
        self._lock = StepLock()  # held while something is computed
        self._state, self._memory = state, memory
        self._in_force = InForce(self._declared, state, memory)
        self._clocked = state.bind_move(origin=memory.origin)

    def _compose(self, start: Start, changes: Sequence[Change]) -> None:
        """Place all parts, and apply the changes."""
        setup = self._declared.placed(start)
        if self._without_python:
            setup = setup.with_set_numbers()
        self._in_force.begin(TimeLine.of(setup, changes))

    def _here(self) -> Start:
        """Return the configuration of the last step."""
        return Start(self._state.snapshot(), self.setup.start.scene)

    def check_derivatives(self, state: RobotState) -> None:
        """Check the user-defined derivatives of the parts, at a state.

        The first step of a run does; see `hsp_control.control.declared_rates`.

        Raises:
            RateError: If a rate or a gradient is wrong, a field, an error or a Jacobian
                depends on v, or the error equation of a task does not follow.
        """
        places = len(terms_of(self._declared.field))
        check_rates(self.setup, None, state, places)

    # -- its parts --------------------------------------------------------------------

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._declared.robot

    @property
    def setup(self) -> Setup:
        """All parts, placed, with the times at which they are active."""
        return self._in_force.setup

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that are active now or fade, placed, the highest priority first."""
        return tuple(task for level in self.levels for task in level)

    @property
    def planned_tasks(self) -> tuple[Task, ...]:
        """All tasks, placed: present, future and past ones."""
        return tuple(each.task for each in self.setup.tasks)

    @property
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """The tasks that are active now or fade, by level, the highest first."""
        levels = self.planned_levels
        return tuple(tuple(each.task for each in level) for level in levels)

    @property
    def planned_levels(self) -> tuple[tuple[PlannedTask, ...], ...]:
        """The same tasks as they are planned, with their keys."""
        now = self._in_force.latest
        levels = [
            tuple(each for each in level if each.present(now))
            for level in self._in_force.mixture.levels
        ]
        return tuple(level for level in levels if level)

    @property
    def field(self) -> NullSpaceField:
        """The null-space field, placed; while it changes, all terms of old and new."""
        return self._in_force.mixture.field

    @property
    def null_space_gain(self) -> Array:
        """K_N in force, shape (nv, nv) [1/s]."""
        return self._in_force.gains.null_space.copy()

    @property
    def metric(self) -> Metric:
        """The joint-space metric."""
        return self.setup.metric

    @property
    def singularity_threshold(self) -> float:
        """Singular value below which an inverse is bounded instead of exact."""
        return self._declared.threshold

    @property
    def limits(self) -> RobotLimits | None:
        """The limits, as numbers of this robot."""
        return self._in_force.limits.limits

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts."""
        return tuple(each.contact for each in self.setup.contacts)

    @property
    def base(self) -> Base | None:
        """The actuation of a floating base besides contacts."""
        return self._declared.base

    @property
    def scene(self) -> Scene:
        """The obstacles that fields and limits name."""
        return self.setup.start.scene

    @property
    def changes(self) -> tuple[Change, ...]:
        """The changes of every run, and those made during this one, by their times.

        Those that were made before the first step, or when the controller was built,
        come in every run. One that is made during a run is forgotten once it is over; a
        log contains all.
        """
        return self._in_force.time_line.known

    @property
    def _changes_made(self) -> int:
        """How many changes there have been: those of every run, and of this one."""
        return len(self._in_force.time_line.declared) + self._in_force.time_line.count

    @property
    def streams(self) -> tuple[StreamRun, ...]:
        """The streams that are followed now, or will be, in this run."""
        return self._memory.streams

    def feedback(self, task: str) -> Feedback:
        """Return the gains in force of a task, and the offset by compensators.

        Raises:
            ControllerError: If there is no such task.
        """
        return self._in_force.gains.feedback[self._task_now(task).key].feedback

    def _task_now(self, name: str) -> PlannedTask:
        """Return the task of a name after the changes that have begun, or a later one.

        Raises:
            ControllerError: If there is no such task, now or later.
        """
        now = self._in_force.time_line.begun(max(self._in_force.latest, 0.0))
        try:
            return now.task(name)
        except ControllerError:
            return self.setup.task(name)

    def offset(self, key: int) -> Array:
        """Return the addition by compensators, who write it, to Kp e of a task, (m,).

        Args:
            key: That of the task; see `planned_levels`.
        """
        return self._in_force.gains.feedback[key].feedback.offset

    def _linear_feedback(self, task: str, state: RobotState) -> dict[float, Feedback]:
        """Return a task's feedback for small errors, by the time when it begins [s]."""
        # That is -inf for the present one, and the ends of the changes that are open.
        planned = self.setup.present_task(task, self._in_force.latest)
        now = planned.task.linear_feedback(
            state, self._in_force.gains.feedback[planned.key]
        )
        found = {-np.inf: now}
        for each in planned.gains.transitions:
            later = planned.task.in_force()
            later.numbers[:] = each.target
            found[each.end] = planned.task.linear_feedback(state, later)
        return found

    def stiffness(self, task: str) -> Array:
        """Return the stiffness K in force of a task with an impedance, shape (m, m).

        A change of it waits where it would add energy; see `ChangeImpedance`.

        Raises:
            ControllerError: If there is no such task, or it has no impedance.
        """
        planned = self.setup.present_task(task, self._in_force.latest)
        if impedance_of(planned.task) is None:
            raise ControllerError(f"task {task!r} has gains, and no stiffness")
        return parts_of(self._in_force.gains.feedback[planned.key].numbers)[0].copy()

    def weight_of(self, task: str, t: float) -> float:
        """Return the weight of a task at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such task.
        """
        return self.setup.present_task(task, t).weight(t)

    def contact_weight(self, contact: str, t: float) -> float:
        """Return how active a contact is at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such contact.
        """
        return self.setup.contact(contact).weight(t)

    def _force_offset(self, contact: str) -> Array:
        """Return the compensators' part of a contact's commanded force, (1,) [N]."""
        return self._memory.force_offset(self.setup.contact(contact).contact.name)

    def __repr__(self) -> str:
        gain = self.null_space_gain
        same = np.array_equal(gain, gain[0, 0] * np.eye(len(gain)))
        tasks = (f"{each.name!r} ({type(each).__name__})" for each in self.tasks)
        return (
            f"Controller of {self.robot.name}: {', '.join(tasks)}; field "
            f"{self.field.name}, K_N = {f'{gain[0, 0]:g}' if same else 'a matrix'}, "
            f"{type(self.metric).__name__}; {'' if self.limits else 'no '}limits"
        )

    def __setattr__(self, name: str, value: object) -> None:
        if name.startswith("_"):
            object.__setattr__(self, name, value)
        elif hasattr(type(self), name):
            instead = _INSTEAD.get(name, "build another one")
            raise ImmutableError(f"Controller.{name} cannot be assigned: {instead}")
        else:
            raise ImmutableError(
                f"Controller has no {name!r} to assign; at(t) changes it while it runs"
            )

    # -- copies -----------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        return {
            "declared": self._declared,
            "time_line": self._in_force.time_line,
            "state": self._state,
            "memory": self._memory,
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self._declared = saved["declared"]
        self._bind_to(saved["state"], saved["memory"])
        self._in_force.begin(saved["time_line"])


_INSTEAD = {
    "tasks": "use at(t).add(task) and at(t).remove(name)",
    "levels": "use at(t).add(task) and at(t).remove(name)",
    "field": "use at(t).field(...)",
    "null_space_gain": "use at(t).null_space_gain(...)",
    "limits": "use at(t).limits(...)",
    "contacts": "use at(t).contact(name, active=...)",
    "scene": "use at(t).obstacle(name, center)",
    "changes": "use at(t)",
    "state": "call compute",
    "active_stack": "call compute",
    "task_rows": "call compute",
}
"""The method to use instead of assigning an attribute."""
