"""The controller: from tasks, a null-space field and a metric to one effort."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from copy import deepcopy
from dataclasses import replace
from math import isfinite
from threading import RLock
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    ControllerError,
    ImmutableError,
    NonFiniteError,
)
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation.limited_step import RELAXED
from hsp_control.control.actuation.limits_in_force import LimitsInForce
from hsp_control.control.changes import Change, Changes, TimeLine
from hsp_control.control.first_state import check_angles, warn_of_jump
from hsp_control.control.gains_in_force import GainsInForce, check_held
from hsp_control.control.mixture import (
    AccelerationModifier,
    BoundStep,
    FreeStep,
    Mixture,
)
from hsp_control.control.output import ControlOutput, Diagnostics
from hsp_control.control.setup import Base, DeclaredController
from hsp_control.control.targets import RAMP, followed_stream, new_stream, target_of
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.start import Start
from hsp_control.law import TaskSample
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.feedback import Feedback
from hsp_control.tasks.impedance import parts_of
from hsp_control.trajectories.streams.stream import Streamed

_MEMORY = 1.0
"""Changes that were complete this long ago are forgotten [s]; an integrator may ask for
earlier times than the last one."""


class Controller:
    """Computes tau = M a + N with the law of Hsu, Hauser and Sastry over a metric.

    Wherever the stacked Jacobian keeps its rank and no limit binds: every task's error
    obeys e'' + Kv e' + Kp e = 0, and V = ½ e_NᵀW e_N obeys V' = -e_NᵀW K_N e_N. The
    same state gives the same effort: its only memory is the last effort, used where
    the effort rate is limited (see `applied`), and how long changes of impedances wait.

    The parts are values and do not change; `at` makes changes while the controller
    runs. What they leave relative (a circle without a centre, ``target="start"``)
    refers to ``start``, or else to the first state for which an effort is computed. A
    controller can be copied and pickled at any time; several threads may share it.
    """

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
            tasks: One task or more, with distinct names. Tasks of the same priority
                form one level; see `Task.priority`.
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
        self._declared = DeclaredController(
            robot,
            tasks,
            field,
            null_space_gain,
            metric,
            singularity_threshold,
            limits,
            contacts,
            base,
            scene,
            start,
        )
        self._allocate(changes)

    def _allocate(self, changes: Sequence[Change]) -> None:
        """Set up what a copy has of its own, and compose the parts."""
        robot, given = self._declared.robot, self._declared.start
        self._lock = _StepLock()
        self._state = RobotState(robot)
        self._gains = GainsInForce(robot.nv)
        self._run = _Run(self._declared.robot.nv)
        q = robot.home() if given is None else given
        state = robot.state(0.0, q, np.zeros(robot.nv))
        start = Start(state, self._declared.scene, known=given is not None)
        self._compose(start, changes)

    # -- what counts at a time --------------------------------------------------------

    def _compose(self, start: Start, changes: Sequence[Change]) -> None:
        """Place all parts, and apply the changes."""
        placed, robot = self._declared.placed(start), self._declared.robot
        driven = self._declared.base == "driven"
        time_line = TimeLine.of(placed, changes)
        self._limits = LimitsInForce(self._state, placed.limits)
        self._mixture = Mixture(
            self._state,
            () if driven else robot.unactuated,
            self._limits,
            self._gains,
            time_line.setup,
            self._declared.threshold,
        )
        self._follow(time_line)

    def _follow(self, time_line: TimeLine) -> None:
        """Let the steps follow a time line."""
        self._run.bound = None
        self._time_line, self._setup = time_line, time_line.setup
        exchanged = self._gains.plan(self._setup, self._latest)
        self._limits.plan(self._setup.limits, self._latest)
        self._mixture.plan(self._setup, exchanged=exchanged)

    @property
    def _latest(self) -> float:
        """The latest time of a step [s]; -inf before the first one."""
        run = self._run
        return max(run.now, self._state.t) if run.begun else -np.inf

    def _here(self) -> Start:
        """Return where the robot was at the last step."""
        state = self._state
        here = self._declared.robot.state(state.t, state.q, state.v)
        return Start(here, self._setup.start.scene)

    def _begin(self) -> None:
        """Look at the first state, and without a start place there what is relative."""
        check_angles(self._declared.robot, self._state.q)
        if self._declared.start is None:
            here = self._here()._replace(scene=self._declared.scene)
            sent = self._limits.sent.memory()
            self._compose(here, self._time_line.made)
            self._limits.remember(sent)
        self._run.begun = True

    def _advance(self) -> None:
        """Write the gains and the limits of the time of the state."""
        run, t = self._run, self._state.t
        if not run.begun:
            self._begin()
        run.now = max(run.now, t)
        opened = self._time_line.open
        if opened:
            if run.now > opened[0].end + _MEMORY:
                self._follow(self._time_line.settled_at(run.now - _MEMORY))
            self._gains.write(t)
            self._limits.write(t)

    # -- the step ---------------------------------------------------------------------

    def compute(
        self,
        t: float | RobotState,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        *,
        modifier: AccelerationModifier | None = None,
        out: ControlOutput | None = None,
    ) -> ControlOutput:
        """Return the effort at a time, configuration and velocity.

        Args:
            t: Time [s]; or a `RobotState` instead of all three; its values are copied.
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
            modifier: Changes the law's acceleration before the limits are applied;
                None: nothing does.
            out: An output of an earlier step, to be overwritten; None: a new one.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf, or a task or the field
                does; a non-finite effort is never returned.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1,
                or an angle of the first state (also after `restart`; later ones are
                not looked at) is farther from the middle of its joint's range than
                twice that range: it would be in degrees.
            ControllerError: If the state belongs to another robot, or what a step
                calls, such as a field, calls its own controller.
        """
        with self._lock:
            run, bound = self._run, self._run.bound
            if (
                bound is not None
                and modifier is None
                and q is not None
                and v is not None
            ):
                # While nothing changes, all of what follows is one call.
                delivered = bound.make(t, q, v)  # type: ignore[arg-type]
                stack, damped = bound.active, bound.damped
            else:
                self._observe(t, q, v)  # the state
                if bound is None:
                    self._advance()  # what counts at its time
                mixture = self._mixture
                mixture.resolve(self._state.t)  # references, and the law
                delivered = mixture.deliver(modifier)  # within the limits
                stack, damped = self.active_stack, mixture.damped
                run.bound = bound or mixture.bound_step()
            run.acceleration, status = delivered[1], delivered[3]
            # Kernels have looked at all other efforts already.
            if (status is RELAXED or modifier is not None) and not isfinite(
                delivered[0] @ delivered[0]
            ):
                stack.raise_not_finite()
            out = ControlOutput() if out is None else out
            out.overwrite(delivered, stack, damped)
            return out

    def _observe(
        self,
        t: float | RobotState,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
    ) -> None:
        """Move the state; see `compute`."""
        if q is not None and v is not None:
            self._state.update(t, q, v)  # type: ignore[arg-type]
        elif not isinstance(t, RobotState):
            missing = " and ".join(
                name for name, value in (("q", q), ("v", v)) if value is None
            )
            raise ControllerError(
                f"compute needs t, q and v, or a RobotState; {missing} is missing"
            )
        elif t.robot is not self._declared.robot:
            raise ControllerError(
                f"the state is of another robot object ({t.robot.name}); "
                f"this controller is for {self._declared.robot.name}"
            )
        elif t is not self._state.seen and t is not self._state:
            self._state.update(t.t, t.q, t.v)

    def applied(self, tau: ArrayLike, period: float) -> None:
        """Store the effort that was sent to the robot.

        It counts for the limit on the effort's rate, and for the margin of speed
        limits, which covers what the robot does while the effort is held. Without
        limits it has no effect. The first one, also after `restart`, is warned of
        (`StartWarning`) where a robot at rest would jump; see `first_state`.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].

        Raises:
            ShapeError: If the effort has another shape.
            NonFiniteError: If the effort or the period contains NaN or inf.
            ControllerError: If the period is not positive.
        """
        own = self._state.effort  # an array of the same kind needs no conversion
        if (
            type(tau) is not np.ndarray
            or tau.shape != own.shape
            or tau.dtype != own.dtype
            or not isfinite(tau.dot(tau))  # half the time of tau @ tau
        ):
            tau = self._declared.robot.check_tangent(tau, "effort tau")
        if not isfinite(period):
            raise NonFiniteError(f"period is {period}; needs a finite number")
        if not period > 0.0:
            raise ControllerError(f"period is {period} s; must be positive")
        if not self._limits.sent.period:
            warn_of_jump(self._declared.robot, self._state.q, self._state.v, tau)
        self._limits.applied(tau, self._run.acceleration, period)
        if self._gains.stiffening:
            self._gains.wait(self.active_stack, self._state.t, period)

    def _while_free(self, advance: Callable[[FreeStep], int]) -> int:
        """Let a compiled loop make steps that are free; return how many it made."""
        # Each is a `compute` that finds no limit violated, and an `applied` for the
        # period of the last one. There are none where something changes, is streamed,
        # is no native call, or the last effort was not the law's own.
        with self._lock:
            run, bound = self._run, self._run.bound
            if (
                bound is None
                or self._gains.stiffening
                or run.acceleration is not bound.active.acceleration
            ):
                return 0
            return 0 if bound.free is None else advance(bound.free)

    def disturbed(self, acceleration: ArrayLike) -> None:
        """Store an acceleration that something else than the efforts causes.

        From now on limits on motion hold for the sum of it and the law's acceleration:
        a robot that somebody pushes may be braked harder, and not driven on. An
        observer tells it; without one the limits hold for the model alone.

        Args:
            acceleration: M⁻¹ times the disturbing efforts, shape (nv,) [rad/s² or
                m/s²].

        Raises:
            ShapeError: If it has another shape.
            NonFiniteError: If it contains NaN or inf.
        """
        known = self._declared.robot.check_tangent(acceleration, "acceleration")
        self._limits.sent.held.disturbance[:] = known

    def restart(self) -> None:
        """Begin anew: forget the last effort, the offsets of tasks, and where it began.

        Changes that were made stay on the time line.
        """
        with self._lock:
            self._limits.forget()
            self._gains.forget()
            self._run = _Run(self._declared.robot.nv)
            self._mixture.active = None  # the next step places what is relative
            made = self._time_line.made
            if made or any(each.task.remembers for each in self._setup.tasks):
                self._compose(self._time_line.start, made)

    def prepare(
        self,
        state: RobotState,
        lifted: Collection[str] = (),
        without: Collection[str] = (),
    ) -> None:
        """Compile the law for some contacts and tasks now, instead of in a step.

        A plan that switches contacts asks for each combination that it will use.

        Args:
            state: A state in which these contacts bear.
            lifted: The names of the contacts that do not bear.
            without: The names of the tasks that do not count.
        """
        with self._lock:
            self._observe(state)
            self._mixture.prepare(self._mixture.stack_without(lifted, without))

    # -- changes while running --------------------------------------------------------

    def at(self, t: float) -> Changes:
        """Return what makes changes that begin at a time [s].

        ``controller.at(2.0).ramp(0.5).gains("hand", hsp.Gains(natural_frequency=20))``.
        Changes count in the order of their times, whatever the order of the calls; each
        continues from what is then in force, so that several may overlap, and efforts
        stay continuous. A time that has passed means now, with the whole ramp.
        """
        return Changes(self.change, t)

    def set_target(self, task: str, target: ArrayLike | pin.SE3) -> Streamed:
        """Let a task go to a target from now on, smoothly, until the next one is set.

        ``controller.set_target("hand", pose)``, at any time and as often as needed. A
        stream takes over from the task's trajectory, with a crossfade, and goes there
        as fast as it may: at 0.5 m/s and 3 m/s², 1.5 rad/s and 8 rad/s². A task that
        was given a stream, with bounds of its own, goes on with that.
        ``controller.at(t).reference(task, trajectory)`` ends it.

        Args:
            task: Name of the task.
            target: For a pose a pin.SE3, x, y, z and a quaternion (x, y, z, w), or a
                matrix; for an orientation a quaternion or a matrix; else the numbers of
                the task's trajectory [m, or the task's unit].

        Returns:
            The stream, which counts what it has taken.

        Raises:
            ControllerError: If there is no such task, it follows no trajectory, or the
                target is of another kind.
            StreamError: If the target is not valid.
        """
        present = self._setup.task(task).task
        value = target_of(present, target)
        stream = followed_stream(present, self._time_line.made)
        if stream is not None:
            stream.send(value)
            return stream
        stream = new_stream(present.followed)
        stream.send(value)
        reference: Any = stream
        self.at(self._state.t).ramp(RAMP).reference(task, reference)
        return stream

    def change(self, change: Change) -> None:
        """Make a change; `at` is the shorter way.

        Raises:
            ControllerError: If it names something that does not exist at its time.
            UnstableRateError: If gains that follow make the running loop unstable at
                its period, without delays, where the robot is now.
            HspControlError: If its parts do not fit the robot.
        """
        with self._lock:
            here, now = None, self._latest
            if self._run.begun:
                change = replace(change, at=max(change.at, now))
                here = self._here()
            time_line = self._time_line.with_change(change, here)
            if period := self._limits.sent.period:
                state = (here or time_line.start).state
                check_held(self._setup, time_line.setup, state, period)
            self._follow(time_line)
            if self._run.begun:  # compile now, not in a step
                self._mixture.prepare(self._mixture.stack_at(now))

    # -- what it is made of -----------------------------------------------------------

    @property
    def robot(self) -> Robot:
        """The robot."""
        return self._declared.robot

    @property
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that count now or fade, placed, the highest priority first."""
        return tuple(task for level in self.levels for task in level)

    @property
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """The tasks that count now or fade, by level, the highest priority first."""
        now = self._latest
        levels = [
            tuple(each.task for each in level if each.presence.at(now) > 0.0)
            for level in self._mixture.levels
        ]
        return tuple(level for level in levels if level)

    @property
    def field(self) -> NullSpaceField:
        """The null-space field, placed; while it changes, all terms of old and new."""
        return self._mixture.field

    @property
    def null_space_gain(self) -> Array:
        """K_N in force, shape (nv, nv) [1/s]."""
        return self._gains.null_space.copy()

    @property
    def metric(self) -> Metric:
        """The joint-space metric."""
        return self._setup.metric

    @property
    def singularity_threshold(self) -> float:
        """Singular value below which an inverse is bounded instead of exact."""
        return self._declared.threshold

    @property
    def limits(self) -> RobotLimits | None:
        """The limits, as numbers of this robot."""
        return self._limits.limits

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts."""
        return tuple(each.contact for each in self._setup.contacts)

    @property
    def base(self) -> Base | None:
        """What else than contacts acts on a floating base."""
        return self._declared.base

    @property
    def scene(self) -> Scene:
        """The obstacles that fields and limits name."""
        return self._setup.start.scene

    @property
    def changes(self) -> tuple[Change, ...]:
        """All changes that were made, in order of their times."""
        return tuple(sorted(self._time_line.made, key=lambda each: each.at))

    @property
    def _settled(self) -> object:
        """An object that stays the same while nothing changes; None while it does."""
        return self._run.bound

    @property
    def state(self) -> RobotState:
        """The state that the last effort was computed for; the next one overwrites it.

        `update` moves it, and nothing else does: its t, q and v cannot be assigned or
        written. Given to `compute` it is not copied.
        """
        return self._state.seen

    def feedback(self, task: str) -> Feedback:
        """Return a task's gains and offset in force; compensators write the offset.

        Raises:
            ControllerError: If there is no such task.
        """
        return self._gains.feedback[self._setup.task(task).key].feedback

    def _linear_feedback(self, task: str, state: RobotState) -> dict[float, Feedback]:
        """Return a task's feedback for small errors, by the time when it begins [s]."""
        # That is -inf for the present one, and the ends of the changes that are open.
        planned = self._setup.present_task(task, self._latest)
        now = planned.task.linear_feedback(state, self._gains.feedback[planned.key])
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
        planned = self._setup.present_task(task, self._latest)
        if impedance_of(planned.task) is None:
            raise ControllerError(f"task {task!r} has gains, and no stiffness")
        return parts_of(self._gains.feedback[planned.key].numbers)[0].copy()

    def weight_of(self, task: str, t: float) -> float:
        """Return how much a task counts at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such task.
        """
        return self._setup.task(task).weight(t)

    def bearing_of(self, contact: str, t: float) -> float:
        """Return how much a contact bears at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such contact.
        """
        return self._setup.contact(contact).weight(t)

    def _force_offset(self, contact: str) -> Array:
        """Return what compensators add to a contact's commanded force, (1,) [N]."""
        return self._setup.contact(contact).force_offset

    def __repr__(self) -> str:
        gain = self.null_space_gain
        same = np.array_equal(gain, gain[0, 0] * np.eye(len(gain)))
        tasks = (f"{each.name!r} ({type(each).__name__})" for each in self.tasks)
        return (
            f"Controller of {self.robot.name}: {', '.join(tasks)}; field "
            f"{self.field.name}, K_N = {f'{gain[0, 0]:g}' if same else 'a matrix'}, "
            f"{type(self.metric).__name__}; {'' if self.limits else 'no '}limits"
        )

    # -- what explains it -------------------------------------------------------------

    @property
    def active_stack(self) -> ActiveStack:
        """The contacts and tasks that the last `compute` resolved.

        Raises:
            ControllerError: If there was none yet.
        """
        active = self._mixture.active
        if active is None:
            raise ControllerError("nothing has been computed yet")
        return active

    def stack(self, state: RobotState) -> TaskSample:
        """Return the rows of all active contacts and tasks at a state."""
        with self._lock:
            self._observe(state)
            self._advance()
            self._mixture.resolve(self._state.t)
            return self.active_stack.rows

    @property
    def task_rows(self) -> Mapping[str, slice]:
        """The rows of each task in the last output's stack, by name."""
        return self.active_stack.task_rows

    def diagnose(self) -> Diagnostics:
        """Return quantities to plot, after `compute`, at the same state."""
        active = self.active_stack
        return Diagnostics(active.field_value(), *active.diagnose())

    def flow(self, t: float, q: ArrayLike) -> Array:
        """Return v = J# x_d' + P g, shape (nv,): the robot once both errors have died.

        The law makes the robot this first-order flow (docs/law.md, Equations (7) and
        (13) over a metric; Liégeois 1977). So it shows what a field will do, and a
        start with this velocity has no transient.
        """
        self.compute(t, q, np.zeros(self.robot.nv))
        return self.active_stack.flow()

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

    def preview(self) -> "Controller":
        """Return a copy at the beginning of a run: to look ahead, or at a log.

        It is of the same robot object. What its streams hear counts for it alone.
        """
        other = deepcopy(self, {id(self._declared.robot): self._declared.robot})
        other._declared = other._declared.preview()
        other.restart()
        return other

    # -- copies -----------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        state = self._state
        return {
            "declared": self._declared,
            "time_line": self._time_line,
            "begun": self._run.begun,
            "now": self._run.now,
            "at": (state.t, state.q.copy(), state.v.copy()),
            "gains": self._gains.memory(),
            "sent": self._limits.sent.memory(),
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        self._declared = saved["declared"]
        self._allocate(())
        self._run.begun, self._run.now = saved["begun"], saved["now"]
        self._follow(saved["time_line"])
        self._gains.remember(saved["gains"])
        self._state.update(*saved["at"])
        self._limits.remember(saved["sent"])


class _Run:
    """What a controller knows of the present run."""

    # Not on the controller itself, whose own attributes cost 0.4 µs to set.
    __slots__ = ("acceleration", "begun", "bound", "now")

    def __init__(self, nv: int) -> None:
        self.acceleration = np.zeros(nv)  # what the last step delivered
        self.begun, self.now = False, -np.inf  # latest time of a step [s]
        self.bound: BoundStep | None = None  # the step, while nothing changes


class _StepLock:
    """A lock: other threads wait for it, and the thread that has it is told."""

    __slots__ = ("_held", "_lock")

    def __init__(self) -> None:
        self._lock, self._held = RLock(), False

    def __enter__(self) -> None:
        self._lock.acquire()
        if self._held:  # by this thread: others are still waiting
            self._lock.release()
            raise ControllerError(
                "a step of a controller calls the same controller, for example within "
                "a field: it would wait for itself for ever; use the state that the "
                "field is given, or a copy, controller.preview()"
            )
        self._held = True

    def __exit__(self, *_: object) -> None:
        self._held = False
        self._lock.release()


_INSTEAD = {
    "tasks": "use at(t).add(task) and at(t).remove(name)",
    "levels": "use at(t).add(task) and at(t).remove(name)",
    "field": "use at(t).field(...)",
    "null_space_gain": "use at(t).null_space_gain(...)",
    "limits": "use at(t).limits(...)",
    "contacts": "use at(t).contact(name, bears=...)",
    "scene": "use at(t).obstacle(name, center)",
    "changes": "use at(t)",
    "state": "call compute",
    "active_stack": "call compute",
    "task_rows": "call compute",
}
"""What to do instead of assigning an attribute."""
