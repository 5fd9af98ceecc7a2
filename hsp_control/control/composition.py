"""What a controller is composed of, and what of it is active at a time."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ControllerError, ImmutableError
from hsp_control.common.keywords import suggesting
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.changes import Change, Changes, TimeLine
from hsp_control.control.declared_rates import check_field, check_metric
from hsp_control.control.first_state import warn_of_far_target
from hsp_control.control.gains_in_force import check_held
from hsp_control.control.in_force import InForce
from hsp_control.control.memory import RunMemory
from hsp_control.control.setup import (
    Base,
    DeclaredController,
    PlannedTask,
    PlannedTerm,
    Setup,
)
from hsp_control.control.step_lock import StepLock
from hsp_control.control.stream_handle import StreamHandle
from hsp_control.control.targets import RAMP, followed_stream, new_stream, target_of
from hsp_control.declaration import within
from hsp_control.geometry.scene import Obstacle, Scene, Start
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import Feedback
from hsp_control.tasks.impedance import parts_of
from hsp_control.trajectories.crossfade import settled
from hsp_control.trajectories.streams.followed import FollowedStream
from hsp_control.trajectories.streams.run import StreamRun
from hsp_control.trajectories.streams.streamed import Streamed
from hsp_control.trajectories.streams.velocities import Axes


class Composition:
    """What a controller is made of, and what of it is active at a time."""

    # whether a program writes what changes; see `Controller.without_python`
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
            base: What moves the free-flyer root besides contacts. ``flying``: nothing;
                ``driven``: something outside, for example a simulator.
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
        """Compute with a state, and remember in a memory."""
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
        """Return where the robot was at the last step."""
        return Start(self._state.snapshot(), self.setup.start.scene)

    # -- changes while running --------------------------------------------------------

    def at(self, t: float) -> Changes:
        """Return what makes changes that begin at a time [s].

        ``controller.at(2.0).ramp(0.5).gains("hand", hsp.Gains(natural_frequency=20))``.
        Changes apply in the order of their times, whatever the order of the calls; each
        continues from what is then in force, so that several may overlap, and efforts
        stay continuous. A time that has passed means now, with the whole ramp.
        """
        return Changes(self.change, t)

    def set_target(self, task: str, target: ArrayLike | pin.SE3) -> StreamHandle:
        """Let a task go to a target from now on, smoothly, until the next one is set.

        ``controller.set_target("hand", pose)``, at any time and as often as needed. A
        stream takes over from the task's trajectory, with a crossfade, and goes there
        as fast as it may: at 0.5 m/s and 3 m/s², 1.5 rad/s and 8 rad/s². A task that
        was given a stream, with bounds of its own, goes on with that.
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
        if not np.abs(value).max() < self._declared.robot.size:  # else it is in reach
            warn_of_far_target(self._here().state, followed, value)
        return self._sent(task, value=value)

    def stream(self, of: str | Streamed) -> StreamHandle:
        """Return what commands a stream: ``controller.stream("hand").send(pose)``.

        Args:
            of: The name of a task: the stream is the one that it follows once all
                changes are over. Or a stream that was given to the controller, for an
                obstacle, say, or for the position of a pose.

        Raises:
            ControllerError: If there is no such task, or it follows no stream, or
                nothing follows the given one.
        """
        self._run_of(of)
        return StreamHandle(lambda: self._run_of(of))

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
        followed = settled(self._followed(of).followed, np.inf)
        if isinstance(followed, FollowedStream):
            return followed.run
        raise ControllerError(
            f"task {of!r} follows no stream, but {type(followed).__name__}; give it "
            "one, such as StreamPose(), or set_target"
        )

    def set_velocity(
        self, task: str, velocity: ArrayLike, axes: Axes = "world"
    ) -> StreamHandle:
        """Let a task move at a velocity from now on, as with a joystick.

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

    def _sent(self, task: str, **message: Any) -> StreamHandle:
        """Send a message to a task's stream, which takes over if there is none yet."""
        present = self._followed(task)
        if followed_stream(present) is None:
            reference: Any = new_stream(present.followed)
            reference.check(getattr(present.followed, "dimension", None), **message)
            self.at(self._state.t).ramp(RAMP).reference(task, reference)
        stream = self.stream(task)
        stream.send(**message)
        return stream

    def _followed(self, task: str) -> Task:
        """Return a task that follows a trajectory."""
        present = self.setup.task(task).task
        if present.followed is None:
            raise ControllerError(f"task {task!r} follows no trajectory")
        return present

    def change(self, change: Change) -> None:
        """Make a change; `at` is the shorter way.

        Raises:
            ControllerError: If it names something that does not exist at its time.
            UnstableRateError: If gains that follow make the running loop unstable at
                its period, without delays, where the robot is now.
            RateError: If a rate that somebody has written of a new field is wrong.
            HspControlError: If its parts do not fit the robot.
        """
        with self._lock:
            here, now, given = None, self._in_force.latest, change
            begun = self._memory.begun
            self._memory.clock.change(change.at, max(now, 0.0))
            if begun:
                change = replace(change, at=max(change.at, now))
                here = self._here()
            known = self._in_force.kept
            time_line = known.with_change(change, here)
            if period := self._memory.sent.period:
                state = (here or time_line.start).state
                check_held(self.setup, time_line.setup, state, period)
            if begun:
                self._check_terms(time_line.setup, self.setup.terms, self._state)
            self._in_force.go_over_to(time_line)
            if begun:
                self._memory.made(now, given)

    def check_derivatives(self, state: RobotState) -> None:
        """Check what somebody has written of the field and the metric, at a state.

        The first step of a run does; see `hsp_control.control.declared_rates`.

        Raises:
            RateError: If a rate or a gradient is wrong, or the field depends on v.
        """
        with within("null_space", "metric"):
            check_metric(self.setup.metric, state)
        self._check_terms(self.setup, (), state)

    def _check_terms(
        self, setup: Setup, known: Sequence[PlannedTerm], state: RobotState
    ) -> None:
        """Check what somebody has written of the terms that are not known yet."""
        checked = {id(each.field) for each in known}
        # Those of the start come first; what a change brings has no place.
        places = 0 if known else len(terms_of(self._declared.field))
        for k, each in enumerate(setup.terms):
            if id(each.field) in checked:
                continue
            with within(*(("null_space", "fields", k) if k < places else ())):
                check_field(each.field, state)

    # -- what it is made of -----------------------------------------------------------

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._declared.robot

    @property
    def setup(self) -> Setup:
        """All parts, placed, and when they count: what a step is bound for."""
        return self._in_force.setup

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that are active now or fade, placed, the highest priority first."""
        return tuple(task for level in self.levels for task in level)

    @property
    def planned_tasks(self) -> tuple[Task, ...]:
        """All tasks, placed: those that are active, have not come yet, or have gone."""
        return tuple(each.task for each in self.setup.tasks)

    @property
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """The tasks that are active now or fade, by level, the highest first."""
        levels = self.planned_levels
        return tuple(tuple(each.task for each in level) for level in levels)

    @property
    def planned_levels(self) -> tuple[tuple[PlannedTask, ...], ...]:
        """The same tasks as they are planned, each with its key."""
        now = self._in_force.latest
        levels = [
            tuple(each for each in level if each.presence.at(now) > 0.0)
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
        """What else than contacts acts on a floating base."""
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
        """Return a task's gains and offset in force; compensators write the offset.

        Raises:
            ControllerError: If there is no such task.
        """
        return self._in_force.gains.feedback[self.setup.task(task).key].feedback

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
        return self.setup.task(task).weight(t)

    def contact_weight(self, contact: str, t: float) -> float:
        """Return how active a contact is at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such contact.
        """
        return self.setup.contact(contact).weight(t)

    def _force_offset(self, contact: str) -> Array:
        """Return what compensators add to a contact's commanded force, (1,) [N]."""
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
"""What to do instead of assigning an attribute."""
