"""The controller: from tasks, a null-space field and a metric to one effort."""

import os
from collections.abc import Callable, Collection, Mapping, Sequence
from copy import deepcopy
from math import isfinite
from threading import RLock
from time import perf_counter
from typing import Any
from weakref import WeakSet

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ControllerError, NonFiniteError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.bound_step import BoundStep, FreeStep
from hsp_control.control.changes import Change
from hsp_control.control.composition import Composition
from hsp_control.control.first_state import (
    check_angles,
    warn_of_far_targets,
    warn_of_jump,
)
from hsp_control.control.memory import Memory
from hsp_control.control.mixture import AccelerationModifier
from hsp_control.control.model_in_force import ModelInForce
from hsp_control.control.output import ControlOutput, Diagnostics
from hsp_control.engine import Dynamics, Plan
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState


class Controller(Composition):
    """Computes tau = M a + N with the law of Hsu, Hauser and Sastry over a metric.

    Wherever the stacked Jacobian keeps its rank and no limit binds: every task's error
    obeys e'' + Kv e' + Kp e = 0, and V = ½ e_NᵀW e_N obeys V' = -e_NᵀW K_N e_N. The
    same state gives the same effort, but for what is remembered of a run (`Memory`):
    the last effort, used where the effort rate or the speed is limited (see `applied`),
    and how long changes of impedances wait.

    Times count from the first step of a run: a robot's clock may begin anywhere.

    The parts are values and do not change; `at` makes changes while the controller
    runs. What they leave relative (a circle without a centre, ``target="start"``)
    refers to ``start``, or else to the first state for which an effort is computed. A
    controller can be copied and pickled at any time; several threads may share it.
    """

    def _bind_to(self, state: RobotState, memory: Memory) -> None:
        self._lock = _StepLock()
        super()._bind_to(state, memory)

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
            t: Time of a clock [s], which may begin anywhere: that of the first step is
                time 0. Or a `RobotState` instead of all three, whose time counts from
                there already; its values are copied.
            q: Configuration, shape (nq,).
            v: Velocity, shape (nv,) [rad/s or m/s].
            modifier: Changes the law's acceleration before the limits are applied;
                None: nothing does.
            out: An output of an earlier step, to be overwritten; None: a new one.

        Raises:
            ShapeError: If q or v has the wrong shape.
            NonFiniteError: If t, q or v contains NaN or inf, or a task or the field
                does; a non-finite effort is never returned.
            RateError: In the first step of a run, if a rate that somebody has written
                of the field or the metric is wrong, or the field depends on v.
            ConfigurationError: If a quaternion or a (cos, sin) pair is not of norm 1,
                or an angle of the first state (also after `restart`; later ones are
                not looked at) is farther from the middle of its joint's range than
                twice that range: it would be in degrees.
            ControllerError: If the state belongs to another robot, or what a step
                calls, such as a field, calls its own controller.
        """
        if out is not None:
            _check_output(out, self._declared.robot.nv)
        with self._lock:
            whole = modifier is None and q is not None and v is not None
            step = self._bound if whole else None
            if step is None or self._settled_later is not None:
                self._observe(t, q, v)  # the state
                self._advance()  # to what is in force at its time
                step = self._bound if whole else None
            if step is not None:  # all that follows is one call
                delivered = step.make(t, q, v)  # type: ignore[arg-type]
                stack, damped = step.active, step.damped
            else:
                mixture = self._mixture
                mixture.resolve(self._state.t)  # references, and the law
                delivered = mixture.deliver(modifier)  # within the limits
                stack, damped = self.active_stack, mixture.damped
                stack.check(delivered.effort)
                if self._bound is None:
                    self._bound = mixture.bound_step(self._memory.origin)
            self._memory.acceleration = delivered.acceleration
            if out is None:
                out = ControlOutput()
                tau, memory = delivered.effort.copy(), stack.memory.tobytes()
                out.write(tau, memory, delivered, stack, damped)
            else:
                out.overwrite(delivered, stack, damped)
            if self._limits.measured:
                out.keep_distances(self._limits.measured)
            return out

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
        """Look at the first state, and without a start place there what is relative."""
        check_angles(self._declared.robot, self._state.q)
        self._memory.clock.begin(self._state.t)
        if self._declared.start is None:
            here = self._here()._replace(scene=self._declared.scene)
            self._compose(here, self._time_line.declared)
        warn_of_far_targets(self._state, self.planned_tasks)
        self.check_derivatives(self._state)
        self._memory.begun = True
        self._write(self._state.t)  # what is bound is called once, at this state
        self._bind_ahead()

    def _advance(self) -> None:
        """Write the gains and the limits of the time of the state."""
        memory, t = self._memory, self._state.t
        if not memory.begun:
            self._begin()
        memory.now = max(memory.now, t)
        if later := self._settled_later:
            if memory.now > later.at:
                self._settle(later)
                return
            self._write(t)

    def applied(self, tau: ArrayLike, period: float) -> None:
        """Store the effort that was sent to the robot.

        The limit on the effort's rate starts from it, and so does the margin of speed
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
        self._memory.clock.look(self._state.t, period, self._state.stamp)
        if not self._memory.sent.period:
            state = self._state
            warn_of_jump(state.robot, state.q, state.v, tau, state.dynamics)
        self._limits.applied(tau, self._memory.acceleration, period)
        if self._gains.stiffening:
            if self._mixture.active is None:  # a copy, made since the step
                self._mixture.resolve(self._state.t)
            self._gains.delay(self.active_stack, self._state.t, period)

    def _while_free(self, advance: Callable[[FreeStep], int]) -> int:
        """Let the engine's loop make steps that are free; return how many it made."""
        # Each is a `compute` that finds no limit violated, and an `applied` for the
        # period of the last one. There are none where something changes, is streamed,
        # is no native call, or the last effort was not the law's own.
        with self._lock:
            bound = self._bound
            if (
                bound is None
                or self._changing
                or self._gains.stiffening
                or self._memory.acceleration is not bound.active.acceleration
            ):
                return 0
            return 0 if bound.free is None else advance(bound.free)

    def disturbed(self, acceleration: ArrayLike) -> None:
        """Store an acceleration that something else than the efforts causes.

        From now on limits on motion hold for the sum of it and the law's acceleration:
        a robot that somebody pushes may be braked harder, and not driven on. An
        observer estimates it; without one the limits hold for the model alone.

        Args:
            acceleration: M⁻¹ times the disturbing efforts, shape (nv,) [rad/s² or
                m/s²].

        Raises:
            ShapeError: If it has another shape.
            NonFiniteError: If it contains NaN or inf.
        """
        known = self._declared.robot.check_tangent(acceleration, "acceleration")
        self._limits.sent.held.disturbance[:] = known

    def followed_by(self, dynamics: Dynamics | None) -> None:
        """Let other dynamics follow changes of payload and gravity, as a plant's do.

        Args:
            dynamics: Those of a robot with the same joints, instead of the last ones;
                None: nobody follows.
        """
        with self._lock:
            self._model.follow(dynamics)

    def model_at(self, t: float) -> None:
        """Let payload and gravity be those of a time of the clock [s].

        A step does it by itself. An observer evaluates the dynamics before it, where
        they would be those of the step before.
        """
        memory = self._memory
        if memory.counts and self._time_line.open and isfinite(t):
            self._model.write(t - memory.origin[0])

    def model_changes(
        self, dynamics: Dynamics | None
    ) -> Callable[[float], object] | None:
        """Return what lets other dynamics follow changes of payload and gravity.

        A simulated robot in another process knows the changes that were declared, and
        follows them by itself; see `followed_by` for one in this process.

        Returns:
            A function of the time [s]; None if nothing changes, or ``dynamics`` is.
        """
        setup = self._setup
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
            origin: What the clock of `compute` reads at time 0, from which references,
                schedules and changes count [s]; None: what it reads in the next step.

        Raises:
            NonFiniteError: If the origin is NaN or inf.
        """
        if origin is not None and not isfinite(origin):
            raise NonFiniteError(f"origin is {origin}; needs a finite number")
        with self._lock:
            line, memory = self._time_line, self._memory
            changes = (*line.declared, *memory.not_seen(self._latest))
            memory.clear()
            self._limits.update()
            self._bound = None
            if origin is not None:
                memory.count_from(origin)
            self._mixture.active = None  # the next step places what is relative
            remembers = any(each.task.remembers for each in self._setup.tasks)
            if changes or line.count or remembers:
                self._compose(line.start, changes)

    def prepare(
        self,
        state: RobotState,
        lifted: Collection[str] = (),
        without: Collection[str] = (),
    ) -> float:
        """Bind the law for some contacts and tasks now, instead of in a step.

        Schedules and changes are bound by themselves: in the first step, and when
        they are made. A plan that switches contacts by events asks for each combination
        that it will use.

        Args:
            state: A state in which the others are active.
            lifted: The names of the contacts that are not active.
            without: The names of the tasks that do not count.

        Returns:
            How long it took [s].
        """
        begun = perf_counter()
        with self._lock:
            self._state.update(state.t, state.q, state.v)
            self._mixture.bind(self._mixture.stack_without(lifted, without))
        return perf_counter() - begun

    @property
    def state(self) -> RobotState:
        """The state that the last effort was computed for; the next one overwrites it.

        Its time counts from the first step. `update` moves it, and nothing else does:
        its t, q and v cannot be assigned or written. Given to `compute` it is not
        copied.
        """
        return self._state.seen

    @property
    def _settled(self) -> object:
        """An object that stays the same while nothing changes; None while it does."""
        return None if self._changing else self._bound

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

    def without_python(self) -> "Controller":
        """Return a preview whose streams are commanded by a program, not by Python."""
        other = self.preview()
        for stream in other._memory.streams:
            stream.leave_python()
        other._compose(other._time_line.start, other._time_line.declared)
        return other

    def step_alone(self, q: ArrayLike | None = None) -> BoundStep | None:
        """Return a step at the beginning of a run, for who makes it without Python.

        What is relative is placed there. The controller is used up: `without_python`
        makes one for this.

        Args:
            q: Where the robot rests, shape (nq,); None: where the controller starts.

        Returns:
            The step, which has its parts; None if it is not the same at all times.
        """
        start = self._setup.start.state.q if q is None else q
        self.compute(0.0, start, np.zeros(self.robot.nv))
        self._state.mass_matrix  # noqa: B018 (of this state: nothing of others is left)
        self._memory.sent.clear()
        self._limits.update()
        return None if self._changing else self._bound

    @property
    def step_plan(self) -> Plan:
        """The calls of a step, from a state to its effort: see `engine.inspection`.

        Raises:
            ControllerError: If there was no step yet, or tasks or contacts change.
        """
        bound = self._bound
        if bound is None:
            raise ControllerError(
                "there is no step whose calls could be shown: compute one, at a time "
                "at which no task or contact fades"
            )
        plan: Plan = bound.move.values["calls"]
        return plan

    def stack(self, state: RobotState) -> TaskSample:
        """Return the rows of all active contacts and tasks; see `stack_at`."""
        return self.stack_at(state).rows

    def stack_at(self, state: RobotState) -> ActiveStack:
        """Return the contacts and tasks that are active at a state, resolved there.

        The state's time counts from the first step. The controller does not move: its
        copy does.
        """
        ahead = self._ahead()
        with ahead._lock:
            ahead._observe(state)
            ahead._advance()
            ahead._mixture.resolve(state.t)
            return ahead.active_stack

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
        start with this velocity has no transient. The time counts from the first step.
        The controller does not move: its copy does.
        """
        ahead = self._ahead()
        ahead.compute(t, q, np.zeros(self.robot.nv))
        return ahead.active_stack.flow()

    def _ahead(self) -> "Controller":
        """Return a copy that goes on from here, to look ahead with its own times."""
        with self._lock:
            ahead = self._copy()
        ahead._memory.count_from(0.0)
        return ahead

    def _copy(self) -> "Controller":
        """Return a copy of the same robot object."""
        return deepcopy(self, {id(self._declared.robot): self._declared.robot})

    def preview(self, changes: Sequence[Change] | None = None) -> "Controller":
        """Return a copy at the beginning of a run: to look ahead, or at a log.

        It is of the same robot object, and counts times from 0. Messages that
        it takes from streams remain for the controller.

        Args:
            changes: All changes of the run, such as those of a log; None: those that
                come in every run.
        """
        other = self._copy()
        other.restart(origin=0.0)
        if changes is not None:
            other._compose(other._time_line.start, changes)
        return other


def _check_output(out: object, nv: int) -> None:
    """Check that an output is one of a controller with as many efforts."""
    if not isinstance(out, ControlOutput):
        raise ControllerError(
            f"out is of type {type(out).__name__}; needs a ControlOutput: that of an "
            "earlier step, or ControlOutput()"
        )
    if (given := out.size) not in (0, nv):
        raise ControllerError(
            f"out is of a step with {given} efforts; this controller has {nv}"
        )


class _StepLock:
    """A lock: other threads wait for it; the thread that holds it gets an error."""

    __slots__ = ("__weakref__", "_lock", "_taken")

    def __init__(self) -> None:
        self._lock, self._taken = RLock(), ""  # why it cannot be had, if so
        _locks.add(self)

    def __enter__(self) -> None:
        self._lock.acquire()
        if self._taken:  # by this thread: others are still waiting
            self._lock.release()
            raise ControllerError(self._taken)
        self._taken = _BY_ITSELF

    def __exit__(self, *_: object) -> None:
        self._taken = ""
        self._lock.release()

    def forked(self) -> None:
        """Go on in a child process: a thread that has the lock is not there."""
        own: Any = self._lock
        if self._taken and not own._is_owned():
            self._lock, self._taken = RLock(), _FORKED


_BY_ITSELF = (
    "a step of a controller calls the same controller, for example within a field: it "
    "would wait for itself for ever; use the state that the field is given, or a copy, "
    "controller.preview()"
)
_FORKED = (
    "this process was forked while another thread computed with this controller, whose "
    "memory is half a step here: make the controller in each process, or start "
    'processes by "spawn"'
)
_locks: WeakSet[_StepLock] = WeakSet()


def _after_fork() -> None:
    for each in [*_locks]:
        each.forked()


if hasattr(os, "register_at_fork"):  # where processes can fork
    os.register_at_fork(after_in_child=_after_fork)
