"""The controller: from tasks, a null-space field and a metric to one effort."""

from collections.abc import Callable, Mapping, Sequence, Set
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ControllerError, NonFiniteError
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation, Status
from hsp_control.control.composition import (
    Base,
    check_parts,
    check_schedules,
    check_support,
    checked_gain,
    levels_of,
)
from hsp_control.law import Outcome, Resolution
from hsp_control.law.outcome import DAMPED, EXACT, NOT_FINITE
from hsp_control.null_space.fields import FieldSample, NullSpaceField, Rest
from hsp_control.null_space.fields.crossfade import crossfade
from hsp_control.null_space.metrics import IdentityMetric, Metric
from hsp_control.null_space.metrics.metric import CONSTANT
from hsp_control.robot import Robot, RobotState
from hsp_control.tasks import Gains, Task, TaskSample
from hsp_control.tasks.gain_ramp import GainRamp
from hsp_control.trajectories.schedule import Schedule


@dataclass(slots=True)
class ControlOutput:
    """The effort at one state, and everything that explains it.

    The arrays are the controller's own and are overwritten by its next `compute`: copy
    what must outlive it.

    Attributes:
        tau: Effort M a + N minus what the contact forces supply, shape (nv,)
            [N·m or N].
        acceleration: a, shape (nv,).
        task: All tasks stacked: J, J', e, e', a_x.
        field: g and g', shape (nv,) each.
        null_space_error: e_N = (I - J#J)(g - v), shape (nv,).
        damped: Whether a task is so near a singularity that its inverse is bounded,
            and the law not exact.
        forces: Forces at the points of the active contacts, in the axes of each
            contact (two tangents, normal), shape (3 points,) [N]; see
            `ActiveStack.support`.
        status: What the limits left of the law's acceleration.
        relaxation: The largest violation of a limit, where limits contradict each
            other [rad/s² or m/s²].
    """

    tau: Array
    acceleration: Array
    task: TaskSample
    field: FieldSample
    null_space_error: Array
    damped: bool
    forces: Array
    status: Status
    relaxation: float


class Diagnostics(NamedTuple):
    """Quantities to plot beside the effort.

    Attributes:
        field_value: The field's cost f, or its norm.
        null_space_norm: ‖e_N‖_W, which decays like exp(-K_N t) for a scalar gain.
        singular_values: Of the tasks' stacked Jacobian in the metric, J L⁻ᵀ, largest
            first.
        manipulability: det(J W⁻¹ Jᵀ), the product of their squares.
    """

    field_value: float
    null_space_norm: float
    singular_values: Array
    manipulability: float


AccelerationModifier = Callable[
    [RobotState, ActiveStack, Array], tuple[Array, Array | None]
]
"""How compensators act between the law and the limits: a function of (state, active
stack, a). It returns the acceleration to deliver, shape (nv,), and an additional effort
besides M a + N, shape (nv,), or None."""


class Controller:
    """Computes tau = M a + N with the law of Hsu, Hauser and Sastry over a metric.

    Wherever the stacked Jacobian keeps its rank and no limit binds: every task's error
    obeys e'' + Kv e' + Kp e = 0, and V = ½ e_NᵀW e_N obeys V' = -e_NᵀW K_N e_N. The
    same state gives the same effort: its only memory is the last effort, used where
    the effort rate is limited (see `applied`).

    Attributes:
        robot: The robot.
        levels: The tasks of each level, the highest priority first.
        tasks: All tasks, in the same order.
        field: The null-space field.
        metric: The joint-space metric.
        null_space_gain: K_N, shape (nv, nv) [1/s].
        contacts: The contacts that may support a floating base.
        limits: The limits on efforts and motion, if any.
        schedules: When each task is active, by name; tasks without one always are.
    """

    def __init__(
        self,
        robot: Robot,
        tasks: Sequence[Task | Sequence[Task]],
        field: NullSpaceField | None = None,
        *,
        null_space_gain: Any = 10.0,
        metric: Metric | None = None,
        singularity_threshold: float = 0.03,
        limits: Limits | None = None,
        contacts: Sequence[Contact] = (),
        base: Base | None = None,
        schedules: Mapping[str, Schedule] | None = None,
    ) -> None:
        """Compose a controller.

        Args:
            robot: The robot.
            tasks: One task or more, with distinct names, stacked at one level; or a
                list of such lists, the highest priority first.
            field: The field g that the self-motion follows; None: `Rest`, g = 0.
            null_space_gain: K_N > 0 [1/s]: scalar, shape (nv,) or (nv, nv).
            metric: Joint-space metric; None: identity.
            singularity_threshold: Singular value of the stacked Jacobian (in the
                metric) below which its inverse is bounded instead of exact. For
                position tasks choose about 3 % of the arm's reach [m]. Near a
                singularity the efforts grow with the inverse cube of this value.
            limits: Limits on efforts and motion; None: no limits.
            contacts: The contacts that may support a robot with a free-flyer root.
            base: What moves the free-flyer root besides contacts. ``flying``: nothing;
                ``driven``: something outside, for example a simulator.
            schedules: When tasks are active, by name; all others always are.

        Raises:
            ControllerError: If tasks, field and robot do not belong together, or the
                tasks of one level have more rows than the robot has dofs.
            ContactError: If a floating base has neither contacts nor ``base``, or a
                fixed base has either.
            GainError: If K_N does not make the null-space error decay.
            MetricError: If the metric does not fit the robot.
        """
        field = Rest(robot) if field is None else field
        metric = IdentityMetric() if metric is None else metric
        levels = levels_of(tasks)
        check_parts(robot, levels, field)
        check_support(robot, contacts, base)
        metric.check(robot.nv)
        if not 0.0 < singularity_threshold < np.inf:
            raise ControllerError(
                f"singularity_threshold is {singularity_threshold}; must be positive"
            )
        if limits is not None and limits.robot is not robot:
            raise ControllerError("the limits were built for another robot object")
        self.robot = robot
        self.levels = levels
        self.tasks = tuple(task for level in levels for task in level)
        self.field = field
        self.metric = metric
        self.null_space_gain = checked_gain(null_space_gain, robot, metric)
        self.contacts = tuple(contacts)
        self.limits = limits
        self.schedules = dict(schedules or {})
        check_schedules(self.schedules, [task.name for task in self.tasks])
        self._threshold = singularity_threshold
        self._actuation = Actuation(
            robot, limits, () if base == "driven" else robot.unactuated
        )
        self._stacks: dict[tuple[Any, ...], ActiveStack] = {}
        self._active: ActiveStack | None = None
        self._mixed, self._modified = np.zeros(robot.nv), np.zeros(robot.nv)
        self._ramps: list[GainRamp] = []
        self._next_field: tuple[float, NullSpaceField] | None = None
        self._timeless = not self.schedules and all(
            contact.schedule.constant for contact in self.contacts
        )

    # -- the step ---------------------------------------------------------------------

    def compute(
        self, state: RobotState, modifier: AccelerationModifier | None = None
    ) -> ControlOutput:
        """Return the effort at a state.

        Args:
            state: The robot's state.
            modifier: Changes the law's acceleration before the limits are applied;
                None: nothing does.

        Raises:
            NonFiniteError: If a task or the field contains NaN or inf; a non-finite
                effort is never returned.
            ControllerError: If the state belongs to another robot.
        """
        if state.robot is not self.robot:
            raise ControllerError(
                f"the state is of another robot object ({state.robot.name}); "
                f"this controller is for {self.robot.name}"
            )
        if self._ramps:
            self._ramps = [ramp for ramp in self._ramps if not ramp.apply(state.t)]
        if self._next_field is not None and state.t >= self._next_field[0]:
            self.field, self._next_field = self._next_field[1], None
        active = self._active
        if active is None or not self._timeless:
            a, outcome = self._scheduled(state)
            active = self.active_stack
        else:
            outcome = active.resolve(state, self.metric, self.field)
            a = active.resolution.acceleration
        if outcome is NOT_FINITE:
            self._explain_non_finite(state)
        offset = None
        if modifier is not None:
            self._modified[:], offset = modifier(state, active, a)
            a = self._modified
        resolution = active.resolution
        tau, a, forces, status, relaxation = self._actuation.deliver(
            state, a, resolution, active.support, offset
        )
        # By name, and without a call of nine arguments, which costs 1 µs.
        output = object.__new__(ControlOutput)
        output.tau, output.acceleration = tau, a
        output.task = active.rows
        output.field = resolution.problem.field
        output.null_space_error = resolution.null_space_error
        output.damped = outcome is DAMPED
        output.forces = forces
        output.status, output.relaxation = status, relaxation
        return output

    def applied(self, tau: Array, period: float) -> None:
        """Store the effort that was sent to the robot, for the limit on its rate.

        Without such a limit it has no effect.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].
        """
        self._actuation.applied(tau, period)

    def restart(self) -> None:
        """Forget the last effort and all task offsets, before another run."""
        self._actuation.forget()
        for task in self.tasks:
            task.offset[:] = 0.0

    def _scheduled(self, state: RobotState) -> tuple[Array, Outcome]:
        """Return the law's acceleration for the tasks that are active, and its outcome.

        A task that fades in or out has a weight between 0 and 1. With w1 ≥ w2 ≥ ... the
        weights of such tasks, the acceleration is

            (1 - w1) a{} + (w1 - w2) a{1} + (w2 - w3) a{1, 2} + ...

        with a{...} the law for the tasks of weight 1 and those in the braces. It is
        continuous in the weights. The rows of the tasks in all sets are linear in a, so
        that these tasks keep their exact error equation throughout.
        """
        t = state.t
        weights = {
            name: schedule.weight(t) for name, schedule in self.schedules.items()
        }
        coming = sorted(
            (name for name, w in weights.items() if 0.0 < w < 1.0),
            key=lambda name: -weights[name],
        )
        off = {name for name, w in weights.items() if w < 1.0}
        shares = [1.0, *(weights[name] for name in coming), 0.0]
        mixed = self._mixed
        mixed[:] = 0.0
        outcome = EXACT
        for k, (share, following) in enumerate(pairwise(shares)):
            active = self._stack_without(state, off - set(coming[:k]))
            self._active = active
            outcome = max(outcome, active.resolve(state, self.metric, self.field))
            a = active.resolution.acceleration
            if not coming:
                break
            mixed += (share - following) * a
            a = mixed
        return a, outcome

    def _stack_without(self, state: RobotState, off: Set[str]) -> ActiveStack:
        """Return the stack of the contacts that are active now, without some tasks."""
        bearing = tuple(c for c in self.contacts if c.schedule.active(state.t))
        key = (tuple(c.name for c in bearing), frozenset(off))
        if key not in self._stacks:
            levels = [[t for t in level if t.name not in off] for level in self.levels]
            self._stacks[key] = ActiveStack(
                state,
                bearing,
                levels,
                self._actuation.base,
                self._actuation.support(bearing),
                self.metric,
                self.null_space_gain,
                self._threshold,
            )
        return self._stacks[key]

    # -- what explains it -------------------------------------------------------------

    @property
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
        self._scheduled(state)
        return self.active_stack.rows

    def level_of(self, task: str) -> int:
        """Return the level that a task is at, 0 the highest.

        Raises:
            ControllerError: If there is no such task.
        """
        check_schedules({task: None}, [each.name for each in self.tasks])
        return next(
            k
            for k, level in enumerate(self.levels)
            if any(each.name == task for each in level)
        )

    @property
    def task_rows(self) -> dict[str, slice]:
        """The rows of each task in the last output's stack, by name."""
        return self.active_stack.task_rows

    @property
    def field_sample(self) -> FieldSample:
        """The field, g and g', at the last `compute`."""
        return self.active_stack.resolution.problem.field

    def diagnose(self, state: RobotState) -> Diagnostics:
        """Return quantities to plot, after `compute` at the same state."""
        active = self.active_stack
        resolution = active.resolution
        singular_values, manipulability = resolution.spectrum(active.first_task_row)
        return Diagnostics(
            self.field.value(state),
            resolution.null_space_norm(),
            singular_values,
            manipulability,
        )

    def flow(self, t: float, q: Array) -> Array:
        """Return v = J# x_d' + P g, shape (nv,): the robot once both errors have died.

        The law makes the robot this first-order flow (docs/law.md, Equations (7) and
        (13) over a metric; Liégeois 1977). So it shows what a field will do, and a
        start with this velocity has no transient.
        """
        state = self.robot.state(t, q, np.zeros(self.robot.nv))
        self.compute(state)
        active = self.active_stack
        problem = active.resolution.problem
        # At rest, without drift and with unit gain the law's acceleration is the flow.
        flow = Resolution(
            np.diff(active.resolution.ends, prepend=0).tolist(),
            self.robot.nv,
            min(self.metric.form, CONSTANT),
            np.eye(self.robot.nv),
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

    # -- changes while it runs --------------------------------------------------------

    def add_task(
        self, task: Task, *, start: float, ramp: float, level: int | None = None
    ) -> None:
        """Add a task that fades in without a jump in effort.

        Args:
            task: The task, with a name of its own.
            start: When it begins to fade in [s].
            ramp: How long it fades in [s].
            level: Its level, 0 the highest; None: the lowest existing one.

        Raises:
            ControllerError: If it belongs to another robot, its name is used already,
                or there is no such level.
        """
        levels = [list(each) for each in self.levels]
        if level is not None and not 0 <= level <= len(levels):
            raise ControllerError(
                f"there is no level {level}; levels are 0 to {len(levels) - 1}, and "
                f"{len(levels)} opens a new one"
            )
        if level == len(levels):
            levels.append([])
        levels[-1 if level is None else level].append(task)
        check_parts(self.robot, levels, self.field)
        self.levels = tuple(tuple(each) for each in levels)
        self.tasks = tuple(each for row in self.levels for each in row)
        self.schedules[task.name] = Schedule([(start, np.inf)], ramp=ramp)
        self._stacks.clear()
        self._timeless = False

    def remove_task(self, name: str, *, start: float, ramp: float) -> None:
        """Remove a task, which fades out without a jump in effort.

        Args:
            name: The task.
            start: When it begins to fade out [s].
            ramp: How long it fades out [s].

        Raises:
            ControllerError: If there is no such task.
        """
        check_schedules({name: None}, [task.name for task in self.tasks])
        self.schedules[name] = Schedule([(-np.inf, start + ramp)], ramp=ramp)
        self._timeless = False

    def change_gains(
        self, name: str, gains: Gains, *, start: float, ramp: float
    ) -> None:
        """Change a task's gains smoothly; its error equation holds throughout.

        Args:
            name: The task.
            gains: The new gains.
            start: When they begin to change [s].
            ramp: How long they change [s].

        Raises:
            ControllerError: If there is no such task.
            GainError: If the gains do not fit it.
        """
        check_schedules({name: None}, [task.name for task in self.tasks])
        task = next(task for task in self.tasks if task.name == name)
        self._ramps.append(GainRamp(task, gains, start, ramp))

    def change_field(self, field: NullSpaceField, *, start: float, ramp: float) -> None:
        """Change to another field smoothly; Proposition 2 holds throughout.

        In between the field is a `crossfade` with its exact rate, so that the
        null-space error decays as if nothing had happened. A change that begins before
        the last one has ended starts from the field at that time.

        Args:
            field: The new field.
            start: When the change begins, now or later [s].
            ramp: How long it takes [s].

        Raises:
            ControllerError: If the field belongs to another robot.
            FieldError: If the ramp is not positive, or one of the two fields leaves the
                null space uncontrolled: there is no blend between the two.
        """
        check_parts(self.robot, self.levels, field)
        self.field = crossfade(self.field, field, start=start, duration=ramp)
        self._next_field = start + ramp, field

    def _explain_non_finite(self, state: RobotState) -> None:
        part = self.active_stack.not_finite()
        if part is not None:
            raise NonFiniteError(
                f"{part} is not finite at t = {state.t:.6g} s; "
                "does its trajectory return NaN or infinity there?"
            )
        if not all(np.isfinite(array).all() for array in self.field_sample):
            raise NonFiniteError(
                f"field {self.field.name!r} is not finite at t = {state.t:.6g} s"
            )
        problem = self.active_stack.resolution.problem
        self.metric.evaluate(state, problem.metric)  # may say what is wrong with it
        raise NonFiniteError(
            f"the effort is not finite at t = {state.t:.6g} s, "
            f"q = {state.q.tolist()}, v = {state.v.tolist()}"
        )
