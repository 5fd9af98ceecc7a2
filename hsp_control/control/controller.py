"""The controller: from tasks, a null-space field and a metric to one effort."""

from collections.abc import Callable, Collection, Mapping, Sequence
from contextlib import suppress
from copy import deepcopy
from math import inf, isfinite
from numbers import Real
from time import perf_counter

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError, NonFiniteError
from hsp_control.common.numbers import check_positive
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation
from hsp_control.control.bound_mixture import BoundMixture
from hsp_control.control.bound_step import BoundStep, FreeStep
from hsp_control.control.changes import Change
from hsp_control.control.commanded import Commanded
from hsp_control.control.first_state import (
    check_angles,
    warn_of_far_targets,
    warn_of_jump,
)
from hsp_control.control.fitting import check_parts
from hsp_control.control.mixture import AccelerationModifier
from hsp_control.control.model_in_force import ModelInForce
from hsp_control.control.output import ControlOutput, Diagnostics
from hsp_control.declaration.language import check_kind
from hsp_control.engine import Dynamics, Plan
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState

_LARGE = 4096
"""Memory [bytes] for which malloc sorts what has been freed: else the next output,
which is larger than most pieces, would have to."""


class Controller(Commanded):
    """Computes tau = M a + N with the law of Hsu, Hauser and Sastry over a metric.

    Wherever the stacked Jacobian keeps its rank and no limit binds: every task's error
    obeys e'' + Kv e' + Kp e = 0, and V = ½ e_NᵀW e_N obeys V' = -e_NᵀW K_N e_N. The
    same state gives the same effort, but for the memory of a run (`RunMemory`):
    the last effort, used where the effort rate or the speed is limited (see `applied`),
    and how long changes of impedances wait.

    Time is zero at the first step of a run: a robot's clock may begin anywhere.

    The parts are values and do not change; `at` makes changes while the controller
    runs. Relative values in them (a circle without a centre, ``target="start"``)
    refer to ``start``, or else to the first state for which an effort is computed. A
    controller can be copied and pickled at any time; several threads may share it.
    """

    # -- the step ---------------------------------------------------------------------

    def compute(
        self,
        t: float | RobotState,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
        *,
        modifier: AccelerationModifier | None = None,
    ) -> ControlOutput:
        """Return the effort at a time, configuration and velocity.

        Args:
            t: Time of a clock [s], which may begin anywhere: that of the first step is
                time 0. Or a `RobotState` instead of all three, whose time starts
                there; its values are copied.
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
            modifier: Changes the law's acceleration before the limits are applied;
                None: nothing does.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf, or a task or the field
                does; a non-finite effort is never returned.
            RateError: In the first step of a run, if a user-defined rate
                of the field or the metric is wrong, or the field depends on v.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1,
                or an angle of the first state (also after `restart`; later ones are
                not looked at) is farther from the middle of its joint's range than
                twice that range: it would be in degrees.
            ControllerError: If the state belongs to another robot, or a function
                that a step calls, such as a field, calls its own controller.
        """
        with self._lock:
            return self._step(t, q, v, modifier)

    def _step(
        self,
        t: float | RobotState,
        q: ArrayLike | None,
        v: ArrayLike | None,
        modifier: AccelerationModifier | None,
    ) -> ControlOutput:
        now, delivered = self._in_force, None
        step = now.step
        if step is None or modifier is not None or q is None or v is None:
            self._observe(t, q, v)  # the state
            self._advance()  # values in force at its time
            t = self._state.t if isinstance(t, RobotState) else t
        else:
            delivered = step.make(t, q, v)  # type: ignore[arg-type]
            now.mixture.resolved, damped = step.resolved, step.damped
        if delivered is None:
            mixture = now.mixture
            # references, the law, and the effort within the limits
            delivered = mixture.step(self._state.t, modifier)
            damped = mixture.damped
            self._active.check(delivered.effort)
            now.bind_step()
        self._memory.acceleration = delivered.acceleration
        resolved, measured = now.mixture.resolved, now.limits.measured
        output = ControlOutput(delivered, resolved, damped, measured)
        if now.later is not None:
            now.passed(self._state.t)
        motion = self._memory.motion
        if t <= motion.latest:  # type: ignore[operator]
            motion.returned(t)  # type: ignore[arg-type]
        motion.latest = t  # type: ignore[assignment]
        if motion.undecided and (wrong := motion.compare(self._state)):
            self._memory.clock.tell(wrong)
        return output

    def _rehearse(self, times: int) -> None:
        # To make a change takes milliseconds, after which the processor's caches hold
        # nothing of a step, and the next one would cost many times as much.
        memory, now, state = self._memory, self._in_force, self._state
        origin, q, v = memory.origin.item(), state.q.copy(), state.v.copy()
        # An error here is also raised in a step, if its cause exists by then.
        with memory.kept(), suppress(Exception):
            for _ in range(times):
                now.mixture.rehearse()
                if isinstance(now.step, BoundMixture):
                    now.step.rehearse(state.t)
                for stream in memory.streams:
                    if not stream.stream.listens_to:
                        stream.rehearse()
                tau = self._step(origin + state.t, q, v, None).tau
                if memory.sent.period:
                    self.applied(tau, memory.sent.period)
        now.limits.update()  # from the last effort
        now.gains.write_all(state.t)
        bytes(_LARGE)

    def _observe(
        self,
        t: float | RobotState,
        q: ArrayLike | None = None,
        v: ArrayLike | None = None,
    ) -> None:
        """Move the state; see `compute`."""
        if q is not None and v is not None:
            if not self._memory.counts:
                self._state.update(t, q, v)  # type: ignore[arg-type]
                self._memory.count_from(self._state.t)
            self._state.advance(self._clocked, t, q, v)  # type: ignore[arg-type]
            return
        if not isinstance(t, RobotState):
            missing = " and ".join(
                name for name, value in (("q", q), ("v", v)) if value is None
            )
            raise ControllerError(
                f"compute needs t, q and v, or a RobotState; {missing} is missing"
            )
        if t.robot is not self._declared.robot:
            raise ControllerError(
                f"the state is of another robot object ({t.robot.name}); "
                f"this controller is for {self._declared.robot.name}"
            )
        if t is not self._state.seen and t is not self._state:
            self._state.update(t.t, t.q, t.v)
        if not self._memory.counts:
            self._memory.count_from(0.0)

    def _begin(self) -> None:
        """Check the first state; without a start, place relative values there."""
        check_angles(self._declared.robot, self._state.q)
        self._memory.clock.begin(self._state.t)
        if self._declared.start is None:
            here = self._here()._replace(scene=self._declared.scene)
            self._compose(here, self._in_force.time_line.declared)
        warn_of_far_targets(self._state, self.planned_tasks)
        self.check_derivatives(self._state)
        self._memory.begun = True
        self._in_force.write(self._state.t)  # bound calls are called once, here
        self._in_force.bind_ahead()

    def _advance(self) -> None:
        """Write the values in force at the time of the state."""
        if not self._memory.begun:
            self._begin()
        self._in_force.advance(self._state.t)

    def applied(self, tau: ArrayLike, period: float) -> None:
        """Store the effort that was sent to the robot.

        The limit on the effort's rate starts from it, and so does the margin of speed
        limits, which covers the motion while the effort is held. Without
        limits it has no effect. The first one, also after `restart`, is warned of
        (`StartWarning`) where a robot at rest would jump; see `first_state`.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].

        Raises:
            ShapeError: If the effort has another shape.
            NonFiniteError: If the effort contains NaN or inf.
            ControllerError: If the period is no positive number.
        """
        own = self._state.effort  # an array of the same kind needs no conversion
        if (
            type(tau) is not np.ndarray
            or tau.shape != own.shape
            or tau.dtype != own.dtype
            or not isfinite(tau.dot(tau))  # half the time of tau @ tau
        ):
            tau = self._declared.robot.check_tangent(tau, "effort tau")
        if type(period) is not float or not 0.0 < period < inf:
            period = check_positive("period", period, "s", ControllerError)
        memory = self._memory
        memory.clock.look(memory.motion.latest, period, self._state.stamp)
        if not self._memory.sent.period:
            state = self._state
            warn_of_jump(state.robot, state.q, state.v, tau, state.dynamics)
        now = self._in_force
        now.limits.applied(tau, self._memory.acceleration, period)
        if now.gains.stiffening:
            now.gains.delay(self._resolved, self._state.t, period)

    def _while_free(self, advance: Callable[[FreeStep], int]) -> int:
        """Let the engine's loop make unconstrained steps; return their number."""
        # A step is a `compute` that finds no limit violated, and an `applied` for the
        # period of the last one. There are none where something changes, is streamed,
        # is no native call, or the last effort was not the law's own.
        with self._lock:
            step = self._settled_step
            if (
                step is None
                or self._in_force.gains.stiffening
                or self._memory.acceleration is not step.active.acceleration
            ):
                return 0
            return 0 if step.free is None else advance(step.free)

    def disturbed(self, acceleration: ArrayLike) -> None:
        """Store an acceleration with causes other than the efforts.

        From now on limits on motion hold for the sum of it and the law's acceleration:
        a pushed robot may be braked harder, and not accelerated further. An
        observer estimates it; without one the limits hold for the model alone.

        Args:
            acceleration: M⁻¹ times the disturbing efforts, shape (nv,) [rad/s² or
                m/s²].

        Raises:
            ShapeError: If it has another shape.
            NonFiniteError: If it contains NaN or inf.
        """
        known = self._declared.robot.check_tangent(acceleration, "acceleration")
        self._in_force.limits.sent.held.disturbance[:] = known

    def followed_by(self, dynamics: Dynamics | None) -> None:
        """Let other dynamics, such as a plant's, follow changes of payload and gravity.

        Args:
            dynamics: Those of a robot with the same joints, instead of the last ones;
                None: none follow.
        """
        with self._lock:
            self._in_force.model.follow(dynamics)

    def model_at(self, t: float) -> None:
        """Let payload and gravity be those of a time of the clock [s].

        A step does it by itself. An observer evaluates the dynamics before it, where
        they would be those of the step before.
        """
        memory = self._memory
        if memory.counts and self._in_force.time_line.open and isfinite(t):
            self._in_force.model.write(t - memory.origin[0])

    def model_changes(
        self, dynamics: Dynamics | None
    ) -> Callable[[float], object] | None:
        """Return a function that updates other dynamics with payload and gravity.

        A simulated robot in another process knows the changes that were declared, and
        follows them by itself; see `followed_by` for one in this process.

        Returns:
            A function of the time [s]; None if nothing changes, or ``dynamics`` is.
        """
        setup = self.setup
        constant = setup.gravity.constant and not setup.payloads
        if dynamics is None or constant:
            return None
        model = ModelInForce(self.robot, [dynamics])
        model.plan(setup.payloads, setup.gravity, -np.inf)
        return model.write

    def restart(self, *, origin: float | None = None) -> None:
        """Begin anew: forget the last effort, the offsets of tasks, and where it began.

        Changes that were declared, or made before the run's first step, come again; so
        does one that was made after its last step, which no step has seen.

        Args:
            origin: The reading of `compute`'s clock at time 0, for references,
                schedules and changes [s]; None: its reading in the next step.

        Raises:
            NonFiniteError: If the origin is NaN or inf.
        """
        if origin is not None and not (
            isinstance(origin, Real) and isfinite(float(origin))
        ):
            raise NonFiniteError(f"origin is {origin!r}; needs a finite number")
        with self._lock:
            now, memory = self._in_force, self._memory
            line = now.time_line
            changes = (*line.declared, *memory.not_seen(now.latest))
            memory.clear()
            now.limits.update()
            now.step = None
            if origin is not None:
                memory.count_from(origin)
            now.mixture.resolved = []  # the next step places relative values
            remembers = any(each.task.remembers for each in self.setup.tasks)
            if changes or line.count or remembers:
                self._compose(line.start, changes)

    def prepare(
        self,
        state: RobotState | None = None,
        lifted: Collection[str] = (),
        without: Collection[str] = (),
    ) -> float:
        """Bind the law for some contacts and tasks now, instead of in a step.

        Schedules and changes are bound by themselves: in the first step, and when
        they are made. A plan that switches contacts by events requests each combination
        that it will use.

        Args:
            state: A state in which the others are active; None: the present one, or
                the start.
            lifted: The names of the contacts that are not active.
            without: The names of the tasks that are not active.

        Returns:
            Its duration [s].
        """
        begun = perf_counter()
        with self._lock:
            mixture = self._in_force.mixture
            if state is not None:
                check_kind("state is", state, RobotState, ControllerError)
                self._state.update(state.t, state.q, state.v)
            mixture.bind(mixture.stack_without(lifted, without))
        return perf_counter() - begun

    @property
    def state(self) -> RobotState:
        """The state that the last effort was computed for; the next one overwrites it.

        Its time starts at the first step. Only `update` moves it:
        its t, q and v cannot be assigned or written. Given to `compute` it is not
        copied.
        """
        return self._state.seen

    @property
    def _settled_step(self) -> BoundStep | None:
        """The step while nothing changes, the same object; None while it does."""
        now = self._in_force
        step = now.step if now.later is None else None
        return step if isinstance(step, BoundStep) else None

    # -- its diagnosis ----------------------------------------------------------------

    @property
    def active_stack(self) -> ActiveStack:
        """The contacts and tasks that the last `compute` resolved, read-only.

        Raises:
            ControllerError: If there was none yet.
        """
        return self._active.shown

    @property
    def stacks(self) -> list[ActiveStack]:
        """All that the last `compute` resolved, read-only; `active_stack` is the last.

        There are several while tasks or contacts fade in or out.

        Raises:
            ControllerError: If there was none yet.
        """
        return [each.shown for each in self._resolved]

    @property
    def _active(self) -> ActiveStack:
        return self._resolved[-1]

    @property
    def _resolved(self) -> list[ActiveStack]:
        mixture = self._in_force.mixture
        if not mixture.resolved:
            if not self._memory.begun:
                raise ControllerError("nothing has been computed yet")
            mixture.resolve(self._state.t)  # of a copy, or since a change
        return mixture.resolved

    def without_python(self, period: float) -> "Controller":
        """Return a preview whose streams, weights and forces a program sets.

        Args:
            period: Time between two steps, and so between two messages [s].
        """
        other = self.preview()
        for stream in other._memory.streams:
            stream.leave_python(period)
        other._without_python = True
        line = other._in_force.time_line
        other._compose(line.start, line.declared)
        return other

    def step_alone(self, q: ArrayLike | None = None) -> BoundStep | None:
        """Return a step at the beginning of a run, for programs without Python.

        Relative values are placed there. The controller is consumed: `without_python`
        makes one for this.

        Args:
            q: Where the robot rests, shape (nq,); None: where the controller starts.

        Returns:
            The step, which has its parts; None if it is not the same at all times.
        """
        start = self.setup.start.state.q if q is None else q
        self.compute(0.0, start, np.zeros(self.robot.nv))
        self._state.mass_matrix  # noqa: B018 (of this state: nothing of others is left)
        self._memory.sent.clear()
        self._in_force.limits.update()
        return self._settled_step

    def stack_alone(self, without: Collection[str]) -> tuple[ActiveStack, Actuation]:
        """Return the stack without some tasks, and its actuation, for `step_alone`.

        Args:
            without: The names of the tasks.
        """
        return self._in_force.mixture.stack_alone(without)

    @property
    def step_plan(self) -> Plan:
        """The calls of a step, from a state to its effort: see `engine.inspection`.

        Raises:
            ControllerError: If there was no step yet, or tasks or contacts change.
        """
        step = self._in_force.step
        if step is None:
            raise ControllerError(
                "there is no step whose calls could be shown: compute one, at a time "
                "at which no task or contact fades"
            )
        plan: Plan = step.move.values["calls"]
        return plan

    def stack(self, state: RobotState) -> TaskSample:
        """Return the rows of all active contacts and tasks; see `stack_at`."""
        return self.stack_at(state).rows

    def stack_at(self, state: RobotState) -> ActiveStack:
        """Return the contacts and tasks that are active at a state, resolved there.

        The state's time starts at the first step. The controller does not move: its
        copy does.
        """
        check_kind("state is", state, RobotState, ControllerError)
        ahead = self._ahead()
        with ahead._lock:
            ahead._observe(state)
            ahead._advance()
            ahead._in_force.mixture.resolve(state.t)
            return ahead._active

    @property
    def task_rows(self) -> Mapping[str, slice]:
        """The tasks' rows in the last output's stack, by name."""
        return self._active.task_rows

    def diagnose(self) -> Diagnostics:
        """Return quantities to plot, after `compute`, at the same state."""
        active = self._active
        return Diagnostics(active.field_value(), *active.diagnose())

    def flow(self, t: float, q: ArrayLike) -> Array:
        """Return v = J# x_d' + P g, shape (nv,): the robot once both errors have died.

        The law makes the robot this first-order flow (docs/law.md, Equations (7) and
        (13) over a metric; Liégeois 1977). So it shows the effect of a field, and a
        start with this velocity has no transient. Time starts at the first step.
        The controller does not move: its copy does.
        """
        ahead = self._ahead()
        ahead.compute(t, q, np.zeros(self.robot.nv))
        return ahead._active.flow()

    def _ahead(self) -> "Controller":
        """Return a copy that continues from here, for previews with its own times."""
        with self._lock:
            ahead = self._copy()
        ahead._memory.count_from(0.0)
        return ahead

    def __copy__(self) -> "Controller":
        """Return a copy that continues independently, of the same robot object."""
        with self._lock:
            return deepcopy(self, {id(self._declared.robot): self._declared.robot})

    def _copy(self) -> "Controller":
        """Return a copy that only reads streams, of the same robot object.

        It also receives the messages to this one's streams, which stay there.
        """
        robot = self._declared.robot
        return deepcopy(self, {id(robot): robot} | self._memory.queues)

    def preview(self, changes: Sequence[Change] | None = None) -> "Controller":
        """Return a copy at the beginning of a run, for previews or a log.

        It is of the same robot object, with times from 0. Messages that
        it reads from streams remain for the controller.

        Args:
            changes: All changes of the run, such as those of a log; None: those that
                come in every run.
        """
        if changes is not None:
            check_parts("changes", changes, Change)
        other = self._copy()
        other.restart(origin=0.0)
        if changes is not None:
            other._compose(other._in_force.time_line.start, changes)
        return other
