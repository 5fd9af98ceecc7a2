"""The controller: from tasks, a null-space field and a metric to one effort."""

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence, Set
from copy import deepcopy
from dataclasses import replace
from itertools import pairwise, takewhile
from math import isfinite
from threading import Lock
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    ControllerError,
    FieldError,
    ImmutableError,
    NonFiniteError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits, RobotLimits
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation
from hsp_control.control.actuation.status import RELAXED
from hsp_control.control.changes import Change, Changes
from hsp_control.control.composition import (
    Base,
    check_kind,
    check_support,
    check_tasks,
    checked_gain,
    priority_of,
)
from hsp_control.control.evolution import PRESENT, Evolution
from hsp_control.control.held_gains import check_held
from hsp_control.control.output import ControlOutput, Diagnostics
from hsp_control.control.planned_contact import PlannedContact
from hsp_control.control.planned_limits import PlannedLimits
from hsp_control.control.read_only import read_only
from hsp_control.control.setup import (
    PlannedTask,
    PlannedTerm,
    Setup,
    levels_of,
    planned_task,
)
from hsp_control.control.stiffening import changes_impedance, next_numbers
from hsp_control.declaration import within
from hsp_control.declaration.nested import parts_within, with_parts_replaced
from hsp_control.geometry.scene import Obstacle, Scene
from hsp_control.geometry.start import Start
from hsp_control.law import Outcome, Resolution
from hsp_control.law.outcome import DAMPED, EXACT, NOT_FINITE
from hsp_control.null_space.fields import NullSpaceField, Rest
from hsp_control.null_space.fields.field import terms_of
from hsp_control.null_space.metrics import IdentityMetric, Metric
from hsp_control.null_space.metrics.metric import CONSTANT
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Task, TaskSample
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.gains import as_gain
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.task import Feedback, InForce
from hsp_control.trajectories.streams.stream import Streamed

AccelerationModifier = Callable[
    [RobotState, ActiveStack, Array], tuple[Array, Array | None]
]
"""How compensators act between the law and the limits: a function of (state, active
stack, a). It returns the acceleration to deliver, shape (nv,), and an additional effort
besides M a + N, shape (nv,), or None."""

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
            null_space_gain: K_N > 0 [1/s]: scalar, shape (nv,) or (nv, nv).
            metric: Joint-space metric; None: identity.
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
            GainError: If K_N does not make the null-space error decay.
            HspControlError: If a part does not fit the robot; the message contains its
                key path.
        """
        if not 0.0 < singularity_threshold < np.inf:
            raise ControllerError(
                f"singularity_threshold is {singularity_threshold}; must be positive"
            )
        self._robot = robot
        self._declared_tasks = tuple(tasks)
        self._declared_field = Rest() if field is None else field
        self._declared_limits = limits
        self._declared_contacts = tuple(contacts)
        self._declared_metric = IdentityMetric() if metric is None else metric
        for task in self._declared_tasks:
            check_kind("tasks contains", task, Task)
        for contact in self._declared_contacts:
            check_kind("contacts contains", contact, Contact)
        check_kind("field is", self._declared_field, NullSpaceField)
        check_kind("metric is", self._declared_metric, Metric)
        if limits is not None:
            check_kind("limits is", limits, Limits)
        self._base = base
        self._scene = scene if isinstance(scene, Scene) else Scene(scene)
        self._threshold = float(singularity_threshold)
        self._changes = tuple(changes)
        self._given_start = None
        if start is not None:
            self._given_start = robot.check_configuration(start).copy()
        check_support(robot, self._declared_contacts, base)
        with within("null_space", "gain"):
            self._declared_gain = as_gain(null_space_gain, "null_space_gain")
        self._allocate()

    def _allocate(self) -> None:
        """Set up what a copy has of its own, and compose the parts."""
        robot = self._robot
        self._lock = Lock()
        self._state = RobotState(robot)
        self._modified, self._mixed = np.zeros((2, robot.nv))
        self._gain = np.zeros((robot.nv, robot.nv))
        self._feedback: dict[int, InForce] = {}
        self._waiting: dict[int, Array] = {}
        self._by_key: dict[int, Task] = {}
        self._stacks: dict[tuple[int, ...], ActiveStack] = {}
        self._field: NullSpaceField = Rest()
        self._now, self._begun = -np.inf, False
        q = robot.home() if self._given_start is None else self._given_start
        state = robot.state(0.0, q, np.zeros(robot.nv))
        self._compose(Start(state, self._scene, known=self._given_start is not None))

    # -- composition ------------------------------------------------------------------

    def _compose(self, start: Start) -> None:
        """Place all parts, and apply the changes."""
        robot = self._robot
        tasks = []
        for task in self._declared_tasks:
            with within("tasks", task.name):
                tasks.append(task.placed(start))
        with within("tasks"):
            check_tasks(tasks, robot)
        with within("null_space", "metric"):
            metric = self._declared_metric.placed(start)
        with within("null_space", "gain"):
            gain = checked_gain(self._declared_gain, robot, metric)
        fields = []
        for k, term in enumerate(terms_of(self._declared_field)):
            with within("null_space", "fields", k):
                _refuse_streams(term)
                fields.append(PlannedTerm(term.placed(start), PRESENT))
        contacts = []
        for contact in self._declared_contacts:
            with within("contacts", contact.name):
                contacts.append(PlannedContact(contact.placed(start), PRESENT))
        limits: RobotLimits | None = None
        if self._declared_limits is not None:
            with within("limits"):
                limits = self._declared_limits.placed(start)
        planned = PlannedLimits.of(limits, robot)
        self._actuation = Actuation(
            robot, planned, () if self._base == "driven" else robot.unactuated
        )
        self._start = start
        self._settled = Setup(
            start,
            metric,
            tuple(planned_task(k, task, PRESENT) for k, task in enumerate(tasks)),
            tuple(fields),
            Evolution(gain),
            tuple(contacts),
            planned,
            len(tasks),
        )
        # In order of time: a change may refer to what an earlier one has made.
        order = sorted(range(len(self._changes)), key=lambda k: self._changes[k].at)
        setup, placed = self._settled, []
        for k in order:
            with within("changes", k):
                placed.append(self._changes[k].placed(start, setup))
                setup = placed[-1].apply(setup)
        self._stacks.clear()
        self._field = Rest()  # an equal one may have a stream of the last run
        self._install(setup)
        self._open = tuple(placed)

    def _install(self, setup: Setup) -> None:
        """Let the steps follow a setup; what stays the same is not compiled again."""
        self._setup = setup
        field = setup.field
        if field != self._field:
            self._field = field
            self._stacks.clear()
        known = {id(task): self._feedback[key] for key, task in self._by_key.items()}
        by_key = {each.key: each.task for each in setup.tasks}
        if any(self._by_key.get(key, task) is not task for key, task in by_key.items()):
            self._stacks.clear()
        self._feedback = {
            key: known.get(id(task)) or self._feedback_of(key, task)
            for key, task in by_key.items()
        }
        self._by_key = by_key
        self._written: set[int] = set()
        self._fading = [each for each in setup.tasks if not each.always]
        self._stiffening = any(
            changes_impedance(each.task, each.gains) for each in setup.tasks
        )
        self._levels = levels_of(setup.tasks, self._robot)
        self._steady = setup.steady and setup.end == -np.inf
        self._active: ActiveStack | None = None
        self._actuation.plan(setup.limits, self._latest)
        self._write_gains(self._latest)

    def _feedback_of(self, key: int, task: Task) -> InForce:
        """Return the feedback of a task that is new, or follows a new trajectory."""
        old = self._by_key.get(key)
        if old is not None and old.name == task.name and old.rows == task.rows:
            return self._feedback[key]
        return task.in_force()

    def _write_gains(self, t: float) -> None:
        """Write the gains of a time; every step reads these arrays."""
        for each in self._setup.tasks:
            if not (each.gains.constant and each.key in self._written):
                numbers = self._waiting.get(each.key)
                numbers = each.gains.at(t) if numbers is None else numbers
                self._feedback[each.key].numbers[:] = numbers
        self._written = set(self._by_key)
        self._gain[:] = self._setup.gain.at(t)

    @property
    def _latest(self) -> float:
        """The latest time of a step [s]; -inf before the first one."""
        return max(self._now, self._state.t) if self._begun else -np.inf

    def _begin(self, state: RobotState) -> None:
        """Place what is relative at the first state, unless a start was given."""
        if self._given_start is None:
            here = self._robot.state(state.t, state.q, state.v)
            last_effort = self._actuation.memory()
            self._compose(Start(here, self._scene))
            self._actuation.remember(last_effort)
        self._begun = True

    # -- the step ---------------------------------------------------------------------

    @overload
    def compute(
        self,
        t: float,
        q: ArrayLike,
        v: ArrayLike,
        *,
        modifier: AccelerationModifier | None = None,
        out: ControlOutput | None = None,
    ) -> ControlOutput: ...

    @overload
    def compute(
        self,
        t: RobotState,
        *,
        modifier: AccelerationModifier | None = None,
        out: ControlOutput | None = None,
    ) -> ControlOutput: ...

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
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1.
            ControllerError: If the state belongs to another robot.
        """
        with self._lock:
            state = self._state
            if q is not None and v is not None:
                state.update(t, q, v)  # type: ignore[arg-type]
            elif t is not state:
                self._adopt(t)
            active = self._active
            if active is None or not self._steady:
                a, outcome = self._mix()
                active = self.active_stack
            else:
                outcome = active.resolve(state.t)
                a = active.acceleration
            if outcome is NOT_FINITE:
                self._explain_non_finite()
            offset = None
            if modifier is not None:
                self._modified[:], offset = modifier(state, active, a)
                a = self._modified
            tau, a, forces, status, relaxation = self._actuation.deliver(
                state, a, active.resolution, active.support, offset
            )
            # Not on the controller itself: its own attributes cost 0.4 µs to set.
            self._actuation.delivered = a
            # The kernel of limited steps has looked at all efforts already.
            if (status is RELAXED or offset is not None) and not isfinite(tau @ tau):
                self._explain_non_finite()
            # By name, and without a call of nine arguments, which costs 1 µs.
            if out is None:
                out = ControlOutput()
                out.tau, out._memory = tau.copy(), active.memory.copy()
                out._views = None
            else:
                out.tau[:] = tau
                out._keep(active.memory)
            out._rows = active.row_count
            out._acceleration = None if a is active.acceleration else a.copy()
            out.forces = forces.copy() if active.has_forces else forces
            out.damped = ""
            if outcome is DAMPED:
                out.damped = active.level_names[active.damped_level - 1]
            out.status, out.relaxation = status, relaxation
            return out

    def _adopt(self, state: object) -> None:
        """Copy the values of a state."""
        if not isinstance(state, RobotState):
            raise ControllerError(
                "compute needs t, q and v, or a RobotState; got "
                f"{type(state).__name__} alone"
            )
        if state.robot is not self._robot:
            raise ControllerError(
                f"the state is of another robot object ({state.robot.name}); "
                f"this controller is for {self._robot.name}"
            )
        self._state.update(state.t, state.q, state.v)

    def applied(self, tau: ArrayLike, period: float) -> None:
        """Store the effort that was sent to the robot.

        It counts for the limit on the effort's rate, and for the margin of speed
        limits, which covers what the robot does while the effort is held. Without
        limits it has no effect.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].

        Raises:
            ShapeError: If the effort has another shape.
            NonFiniteError: If the effort or the period contains NaN or inf.
            ControllerError: If the period is not positive.
        """
        own = self._actuation.delivered  # an array of the same kind needs no conversion
        if (
            type(tau) is not np.ndarray
            or tau.shape != own.shape
            or tau.dtype != own.dtype
            or not isfinite(tau @ tau)
        ):
            tau = self._robot.check_tangent(tau, "effort tau")
        if not isfinite(period):
            raise NonFiniteError(f"period is {period}; needs a finite number")
        if not period > 0.0:
            raise ControllerError(f"period is {period} s; must be positive")
        self._actuation.applied(self._state, tau, period)
        if self._stiffening or self._waiting:
            self._wait(period)

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
        known = self._robot.check_tangent(acceleration, "acceleration")
        self._actuation.disturbed(known)

    def _wait(self, period: float) -> None:
        """Let changes of impedances wait where they would add energy."""
        t, active = self._state.t, self.active_stack
        for each in self._setup.tasks:
            changes = each.key in self._waiting or changes_impedance(
                each.task, each.gains
            )
            rows = active.task_rows.get(each.task.name)
            if not changes or rows is None:
                continue
            in_force, sample = self._feedback[each.key], active.rows
            following = next_numbers(
                in_force.numbers,
                each.gains,
                in_force.mobility,
                sample.error[rows],
                sample.error_rate[rows],
                t,
                period,
            )
            if following is None:
                self._waiting.pop(each.key, None)
                following = each.gains.at(t + period)
            else:
                self._waiting[each.key] = following
            in_force.numbers[:] = following

    def restart(self) -> None:
        """Begin anew: forget the last effort, the offsets of tasks, and where it began.

        Changes that were made stay on the time line.
        """
        with self._lock:
            self._actuation.forget()
            self._now, self._begun = -np.inf, False
            self._waiting.clear()
            self._active = None  # the next step places what is relative
            for in_force in self._feedback.values():
                in_force.feedback.offset[:] = 0.0
            if self._changes or any(each.task.remembers for each in self._setup.tasks):
                self._compose(self._start)

    def _mix(self) -> tuple[Array, Outcome]:
        """Return the law's acceleration for the tasks that are active, and its outcome.

        A task that fades in or out has a weight between 0 and 1. With w1 ≥ w2 ≥ ... the
        weights of such tasks, the acceleration is

            (1 - w1) a{} + (w1 - w2) a{1} + (w2 - w3) a{1, 2} + ...

        with a{...} the law for the tasks of weight 1 and those in the braces. It is
        continuous in the weights. The rows of the tasks in all sets are linear in a, so
        that these tasks keep their exact error equation throughout.
        """
        t = self._state.t
        if not self._begun:
            self._begin(self._state)
        self._now = max(self._now, t)
        if self._open:
            if self._now > self._open[0].end + _MEMORY:
                self._settle(self._now - _MEMORY)
            self._write_gains(t)
            self._actuation.update_limits(t)
        weights = {each.key: each.weight(t) for each in self._fading}
        coming = sorted(
            (key for key, w in weights.items() if 0.0 < w < 1.0),
            key=lambda key: -weights[key],
        )
        off = {key for key, w in weights.items() if w < 1.0}
        shares = [1.0, *(weights[key] for key in coming), 0.0]
        mixed = self._mixed
        mixed[:] = 0.0
        outcome = EXACT
        for k, (share, following) in enumerate(pairwise(shares)):
            active = self._stack_without(t, off - set(coming[:k]))
            self._active = active
            outcome = max(outcome, active.resolve(t))
            a = active.resolution.acceleration
            if not coming:
                break
            mixed += (share - following) * a
            a = mixed
        return a, outcome

    def _settle(self, t: float) -> None:
        """Forget the changes that were complete at a time, and all changes before."""
        done = list(takewhile(lambda each: each.end <= t, self._open))
        self._settled = _applied(done, self._settled).settled(t)
        self._open = self._open[len(done) :]
        self._install(_applied(self._open, self._settled))

    def _stack_without(self, t: float, off: Set[int]) -> ActiveStack:
        """Return the stack of the contacts that are active now, without some tasks."""
        bearing = [each for each in self._setup.contacts if each.active(t)]
        return self._stack_of(bearing, off)

    def _stack_of(
        self, bearing: Sequence[PlannedContact], off: Set[int]
    ) -> ActiveStack:
        """Return the stack of some contacts, without some tasks."""
        on = [each.key for each in self._setup.tasks if each.key not in off]
        # By identity: to compare values would cost more than the step.
        key = (*map(id, bearing), -1, *on, id(self._field))
        if key not in self._stacks:
            stack = ActiveStack(
                self._state,
                self._actuation.support(bearing),
                [[each for each in level if each.key in on] for level in self._levels],
                self._feedback,
                self._actuation.base,
                self._setup.metric,
                self._field,
                self._gain,
                self._threshold,
            )
            self._actuation.prepare(self._state, stack.resolution, stack.support)
            self._stacks[key] = stack
        return self._stacks[key]

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
            if state is not self._state:
                self._adopt(state)
            setup = self._setup
            bearing = [c for c in setup.contacts if c.contact.name not in lifted]
            off = {each.key for each in setup.tasks if each.task.name in without}
            self._stack_of(bearing, off).prepare()

    # -- changes while running --------------------------------------------------------

    def at(self, t: float) -> Changes:
        """Return what makes changes that begin at a time [s].

        ``controller.at(2.0).ramp(0.5).gains("hand", hsp.Gains(natural_frequency=20))``.
        Changes count in the order of their times, whatever the order of the calls; each
        continues from what is then in force, so that several may overlap, and efforts
        stay continuous. A time that has passed means now, with the whole ramp.
        """
        return Changes(self.change, t)

    def change(self, change: Change) -> None:
        """Make a change; `at` is the shorter way.

        Raises:
            ControllerError: If it names something that does not exist at its time.
            UnstableRateError: If gains that follow make the running loop unstable at
                its period, without delays, where the robot is now.
            HspControlError: If its parts do not fit the robot.
        """
        with self._lock:
            start, now = self._start, self._latest
            if self._begun:
                change = replace(change, at=max(change.at, now))
                state = self._state
                here = self._robot.state(state.t, state.q, state.v)
                start = Start(here, self._setup.start.scene)
            earlier = [each for each in self._open if each.at <= change.at]
            placed = change.placed(start, _applied(earlier, self._settled))
            opened = _in_order((*self._open, placed))
            setup = _applied(opened, self._settled)
            if self._actuation.period:
                check_held(self._setup, setup, start.state, self._actuation.period)
            self._install(setup)
            self._open = opened
            made = placed if self._begun else change
            self._changes = (*self._changes, made)
            if self._begun:  # compile now, not in a step
                stack = self._stack_without(now, set())
                stack.prepare()
                self._actuation.prepare(self._state, stack.resolution, stack.support)

    # -- what it is made of -----------------------------------------------------------

    @read_only()
    def robot(self) -> Robot:
        """The robot."""
        return self._robot

    @read_only("use at(t).add(task) and at(t).remove(name)")
    def tasks(self) -> tuple[Task, ...]:
        """The tasks that count now or fade, placed, the highest priority first."""
        return tuple(task for level in self.levels for task in level)

    @read_only("use at(t).add(task) and at(t).remove(name)")
    def levels(self) -> tuple[tuple[Task, ...], ...]:
        """The tasks that count now or fade, by level, the highest priority first."""
        now = self._latest
        levels = [
            tuple(each.task for each in level if each.presence.at(now) > 0.0)
            for level in self._levels
        ]
        return tuple(level for level in levels if level)

    @read_only("use at(t).field(...)")
    def field(self) -> NullSpaceField:
        """The null-space field, placed; while it changes, all terms of old and new."""
        return self._field

    @read_only("use at(t).null_space_gain(...)")
    def null_space_gain(self) -> Array:
        """K_N in force, shape (nv, nv) [1/s]."""
        return self._gain.copy()

    @read_only()
    def metric(self) -> Metric:
        """The joint-space metric."""
        return self._setup.metric

    @read_only()
    def singularity_threshold(self) -> float:
        """Singular value below which an inverse is bounded instead of exact."""
        return self._threshold

    @read_only("use at(t).limits(...)")
    def limits(self) -> RobotLimits | None:
        """The limits, as numbers of this robot."""
        return self._actuation.limits

    @read_only("use at(t).contact(name, bears=...)")
    def contacts(self) -> tuple[Contact, ...]:
        """The contacts."""
        return tuple(each.contact for each in self._setup.contacts)

    @read_only()
    def base(self) -> Base | None:
        """What else than contacts acts on a floating base."""
        return self._base

    @read_only("use at(t).obstacle(name, center)")
    def scene(self) -> Scene:
        """The obstacles that fields and limits name."""
        return self._setup.start.scene

    @read_only("use at(t)")
    def changes(self) -> tuple[Change, ...]:
        """All changes that were made, in order of their times."""
        return tuple(sorted(self._changes, key=lambda each: each.at))

    @read_only("call compute")
    def state(self) -> RobotState:
        """The state that the last effort was computed for; the next one overwrites it.

        It may be updated and given to `compute`, which then copies nothing.
        """
        return self._state

    def feedback(self, task: str) -> Feedback:
        """Return a task's gains and offset in force; compensators write the offset.

        Raises:
            ControllerError: If there is no such task.
        """
        return self._in_force(task).feedback

    def linear_feedback(self, task: str, state: RobotState) -> dict[float, Feedback]:
        """Return a task's feedback for small errors about a state, now and later.

        With gains it is the one in force; an impedance gives other gains at each state.

        Returns:
            The feedback, by the time from which it is in force [s]: -inf for now, and
            the ends of the changes that are open.

        Raises:
            ControllerError: If there is no such task.
        """
        planned = self._present(task)
        now = planned.task.linear_feedback(state, self._feedback[planned.key])
        found = {-np.inf: now}
        for each in planned.gains.transitions:
            later = planned.task.in_force()
            later.numbers[:] = each.target
            found[each.end] = planned.task.linear_feedback(state, later)
        return found

    def _present(self, task: str) -> PlannedTask:
        """Return the task of a name that counts now, or is to come."""
        now = self._latest
        for each in self._setup.tasks:
            if each.task.name == task and each.presence.at(now) > 0.0:
                return each
        return self._setup.tasks[self._setup.find_task(task)]

    def stiffness(self, task: str) -> Array:
        """Return the stiffness K in force of a task with an impedance, shape (m, m).

        A change of it waits where it would add energy; see `ChangeImpedance`.

        Raises:
            ControllerError: If there is no such task, or it has no impedance.
        """
        planned = self._present(task)
        if impedance_of(planned.task) is None:
            raise ControllerError(f"task {task!r} has gains, and no stiffness")
        return parts_of(self._feedback[planned.key].numbers)[0].copy()

    def _in_force(self, task: str) -> InForce:
        return self._feedback[self._setup.tasks[self._setup.find_task(task)].key]

    def weight_of(self, task: str, t: float) -> float:
        """Return how much a task counts at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such task.
        """
        return self._setup.tasks[self._setup.find_task(task)].weight(t)

    def bearing_of(self, contact: str, t: float) -> float:
        """Return how much a contact bears at time t [s], in [0, 1].

        Raises:
            ControllerError: If there is no such contact.
        """
        there = {each.contact.name: each for each in self._setup.contacts}
        if contact not in there:
            raise ControllerError(
                f"there is no contact {contact!r}{did_you_mean(contact, there)} "
                f"(there are {listing(there) or 'none'})"
            )
        return there[contact].weight(t)

    def priority_of(self, task: str) -> int:
        """Return the priority of a task, 1 the highest.

        Raises:
            ControllerError: If there is no such task.
        """
        planned = self._setup.tasks[self._setup.find_task(task)]
        return priority_of(planned.task, self._robot)

    # -- what explains it -------------------------------------------------------------

    @read_only("call compute")
    def active_stack(self) -> ActiveStack:
        """The contacts and tasks that the last `compute` resolved.

        Raises:
            ControllerError: If there was none yet.
        """
        if self._active is None:
            raise ControllerError("nothing has been computed yet")
        return self._active

    def stack(self, state: RobotState) -> TaskSample:
        """Return the rows of all active contacts and tasks at a state."""
        with self._lock:
            if state is not self._state:
                self._adopt(state)
            self._mix()
            return self.active_stack.rows

    @read_only("call compute")
    def task_rows(self) -> Mapping[str, slice]:
        """The rows of each task in the last output's stack, by name."""
        return self.active_stack.task_rows

    def diagnose(self) -> Diagnostics:
        """Return quantities to plot, after `compute`, at the same state."""
        active = self.active_stack
        resolution = active.resolution
        singular_values, manipulability = resolution.spectrum(active.first_task_row)
        return Diagnostics(
            self._field.value(self._state),
            resolution.null_space_norm(),
            singular_values,
            manipulability,
        )

    def flow(self, t: float, q: ArrayLike) -> Array:
        """Return v = J# x_d' + P g, shape (nv,): the robot once both errors have died.

        The law makes the robot this first-order flow (docs/law.md, Equations (7) and
        (13) over a metric; Liégeois 1977). So it shows what a field will do, and a
        start with this velocity has no transient.
        """
        nv, state = self._robot.nv, self._state
        self.compute(t, q, np.zeros(nv))
        active = self.active_stack
        problem = active.resolution.problem
        # At rest, without drift and with unit gain the law's acceleration is the flow.
        flow = Resolution(
            np.diff(active.resolution.ends, prepend=0).tolist(),
            nv,
            min(self.metric.form, CONSTANT),
            np.eye(nv),
            self._threshold,
        )
        flow.problem.task.jacobian[:] = active.rows.jacobian
        for level in active.levels:
            for task in level:
                rate = task.reference_rate(state)
                flow.problem.task.acceleration[active.task_rows[task.name]] = rate
        flow.problem.field.g[:] = problem.field.g
        flow.problem.metric.W[:], flow.problem.metric.L[:] = problem.metric[:2]
        return flow.resolve(state.v).acceleration

    def _explain_non_finite(self) -> None:
        state = self._state
        part = self.active_stack.not_finite()
        if part is not None:
            raise NonFiniteError(
                f"{part} is not finite at t = {state.t:.6g} s; "
                "does its trajectory return NaN or infinity there?"
            )
        problem = self.active_stack.resolution.problem
        if not all(np.isfinite(array).all() for array in problem.field):
            raise NonFiniteError(
                f"field {self._field.name!r} is not finite at t = {state.t:.6g} s"
            )
        self._setup.metric.evaluate(state, problem.metric)  # may say what is wrong
        raise NonFiniteError(
            f"the effort is not finite at t = {state.t:.6g} s, "
            f"q = {state.q.tolist()}, v = {state.v.tolist()}"
        )

    def __setattr__(self, name: str, value: object) -> None:
        if not name.startswith("_") and not hasattr(type(self), name):
            raise ImmutableError(
                f"Controller has no {name!r} to assign; at(t) changes it while it runs"
            )
        object.__setattr__(self, name, value)

    def preview(self) -> "Controller":
        """Return a copy at the beginning of a run: to look ahead, or at a log.

        It is of the same robot object. What its streams hear counts for it alone.
        """
        other = deepcopy(self, {id(self._robot): self._robot})
        other._declared_tasks = tuple(
            with_parts_replaced(task, Streamed, Streamed.preview)
            for task in self._declared_tasks
        )
        other.restart()
        return other

    # -- copies -----------------------------------------------------------------------

    def __getstate__(self) -> dict[str, Any]:
        state = self._state
        return {
            "declared": {name: getattr(self, name) for name in _DECLARED},
            "begun": self._begun,
            "start": self._start,
            "settled": self._settled,
            "open": self._open,
            "now": self._now,
            "waiting": {k: each.copy() for k, each in self._waiting.items()},
            "at": (state.t, state.q.copy(), state.v.copy()),
            "offsets": {
                k: each.feedback.offset.copy() for k, each in self._feedback.items()
            },
            "last_effort": self._actuation.memory(),
        }

    def __setstate__(self, saved: dict[str, Any]) -> None:
        vars(self).update(saved["declared"])
        self._allocate()
        self._start, self._settled = saved["start"], saved["settled"]
        self._open, self._begun, self._now = saved["open"], saved["begun"], saved["now"]
        self._waiting = saved["waiting"]
        self._install(_applied(self._open, self._settled))
        for key, offset in saved["offsets"].items():
            self._feedback[key].feedback.offset[:] = offset
        self._state.update(*saved["at"])
        self._actuation.remember(saved["last_effort"])


_DECLARED = (
    "_base",
    "_changes",
    "_declared_contacts",
    "_declared_field",
    "_declared_gain",
    "_declared_limits",
    "_declared_metric",
    "_declared_tasks",
    "_given_start",
    "_robot",
    "_scene",
    "_threshold",
)
"""The attributes from which all others are made."""


def _refuse_streams(field: NullSpaceField) -> None:
    """Raise for a field that a stream leads from the start: only a change's is logged.

    Raises:
        FieldError: If there is one.
    """
    if any(True for _ in parts_within(field, Streamed)):
        raise FieldError(
            "a stream cannot lead a field from the start; while the controller runs, "
            "controller.at(t).field(...) with a stream does"
        )


def _in_order(changes: Iterable[Change]) -> tuple[Change, ...]:
    """Return changes in order of time; those of one time in their order."""
    return tuple(sorted(changes, key=lambda change: change.at))


def _applied(changes: Iterable[Change], setup: Setup) -> Setup:
    """Return the setup with changes, in order of time."""
    for change in _in_order(changes):
        setup = change.apply(setup)
    return setup
