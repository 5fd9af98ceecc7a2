"""From the law's acceleration to efforts and contact forces within the limits.

Minimise ½ δᵀH δ over a = a* + δ, with a* the law's acceleration and

    H = Σ ρ_k N_k N_kᵀ,      ρ_1 = 1 > ρ_2 > ... > ρ_N

in whitened coordinates, N_k the directions of the tasks of level k in the null space of
those above, and ρ_N the cost of motion in the null space of all tasks. So the null
space deviates first, then the tasks, the lowest priority first. The constraints are
affine in δ and the contact forces, see `limited_step`.

If a* violates no constraint it is the optimum, and no QP is solved. ``docs/law.md``,
Contacts and floating bases, and Limits.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.common.step_plan import in_order
from hsp_control.constraints.limits import RobotLimits
from hsp_control.constraints.limits.acceleration_bounds import (
    EFFORT,
    MOTION,
    Bounds,
    MotionLimits,
    violated_limits,
    within,
)
from hsp_control.control.actuation.held_effort import (
    Held,
    HeldEffort,
    effort_window,
    observe,
)
from hsp_control.control.actuation.limited_step import Barriers, LimitedStep
from hsp_control.control.actuation.status import EXACT, LIMITED, Status
from hsp_control.control.actuation.support import Support
from hsp_control.control.planned import PlannedContact, PlannedLimits, mean_of
from hsp_control.law import Resolution
from hsp_control.robot import Robot, RobotState

_NO_ROWS: Barriers = {}

FLAGS, CODES = 4, 16
"""What `Actuation.checks` finds is the law's code times `CODES`, plus the flags of
violated limits times `FLAGS`, plus the `Status` of a step that is limited already: that
is in `Actuation.limited`, and nothing is left to `deliver`."""

Delivered = tuple[Array, Array, Array, Status, float]
"""What the actuation delivers: effort, shape (nv,) [N·m or N], zero where there is no
motor; acceleration, shape (nv,); contact forces in the axes of each contact, shape
(size,) [N]; the `Status`; and the largest violation of a relaxed limit [rad/s² or
m/s²]."""


class Kept(NamedTuple):
    """One set of limits, and what is made for it."""

    limits: RobotLimits | None
    steps: WeakKeyDictionary[Resolution, LimitedStep]  # QP of each law
    box: bool  # whether there are but bounds on accelerations and efforts
    rate: bool  # whether the effort's rate is limited

    @classmethod
    def of(cls, limits: RobotLimits | None) -> "Kept":
        """Return what keeps a set of limits."""
        barriers = limits is not None and (limits.distances or limits.static_effort)
        rate = limits is not None and bool(np.isfinite(limits.effort_rate).any())
        return cls(limits, WeakKeyDictionary(), box=not barriers, rate=rate)


class Actuation:
    """Computes efforts and contact forces for accelerations, within limits.

    Its only memory is of the last efforts, used where the effort rate or the speed is
    limited: see `applied`. While one set of limits follows another it keeps the one
    that was enforced last: see `Mixture.deliver`.
    """

    def __init__(
        self, robot: Robot, planned: PlannedLimits, base: Sequence[int] = ()
    ) -> None:
        nv = robot.nv
        self._robot = robot
        self.base: Indices = np.array(base, dtype=np.int64)  # those without a motor
        self._floating = bool(self.base.size)
        self._motors: Indices = np.setdiff1d(np.arange(nv), self.base)
        self._weight = 9.81 * sum(inertia.mass for inertia in robot.model.inertias)
        self._a_lower, self._a_upper = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._tau_lower, self._tau_upper = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._bounds = Bounds(
            self._a_lower, self._a_upper, self._tau_lower, self._tau_upper
        )
        self._effort = np.zeros(nv)
        self._found = np.zeros(2)  # what a check returned, and its flags
        self._resolution: Resolution | None = None
        self._step: LimitedStep | None = None
        # what the last step delivers that was limited within a call of `checks`
        self.limited: Delivered
        self.delivered: Array = np.zeros(nv)
        self.period = 0.0
        self._held = HeldEffort(nv)
        self._sent = np.zeros(nv + 1)  # the last effort, and how long it is held
        # Kernels read these copies, which stay where they are when limits change.
        self._efforts = np.full((2, nv), np.inf)
        zeros = np.zeros
        self._motion = MotionLimits(
            zeros(nv), zeros(nv), zeros(nv), zeros(nv), zeros(nv), zeros(1)
        )
        self._checks: dict[tuple[int, int, bool], Sequence[Callable[..., Any]]] = {}
        self._permits = IdentityCache(self._bind_permits)
        self._window: Callable[[], float] | None = None
        self._rate_limited = False
        self._kept = Kept.of(None)
        self._no_forces = np.zeros(0)
        self._no_support = Support((), robot, self._weight)
        self.plan(planned, -np.inf)

    def plan(self, planned: PlannedLimits, t: float) -> None:
        """Keep other limits from now on; t is the present time [s]."""
        if not self._rate_limited:
            self._sent[-1] = 0.0  # what was sent is not known
        self._all = [(Kept.of(each), share) for each, share in planned.sets]
        self._rate_limited = any(kept.rate for kept, _ in self._all)
        self._checks.clear()
        if self._window is None and any(kept.limits for kept, _ in self._all):
            self._window = bind(
                effort_window,
                *(self._sent, *self._efforts, self._tau_lower, self._tau_upper),
            )
        self._count_sets(t)

    def is_direct(self, support: Support) -> bool:
        """Return whether M a + N is the effort wherever `violated` finds nothing."""
        return self._kept.box and not self._floating and not support.size

    @property
    def limits(self) -> RobotLimits | None:
        """The limits in force, if any; of several sets their mean."""
        return mean_of([(kept.limits, share) for kept, share in self.sets], self._robot)

    @property
    def _limits_anything(self) -> bool:
        return any(kept.limits is not None for kept, _ in self.sets)

    def update_limits(self, t: float) -> None:
        """Find the limits in force at time t [s], if they change."""
        if len(self._all) > 1:
            self._count_sets(t)

    def _count_sets(self, t: float) -> None:
        """Find the sets of limits in force, and enforce the last of them."""
        shares = [(kept, share.at(t)) for kept, share in self._all]
        self.sets = [pair for pair in shares if pair[1] > 0.0]
        self.enforce(self.sets[-1][0])

    def enforce(self, kept: Kept) -> None:
        """Keep one of the sets of limits until another one is enforced."""
        if kept is self._kept:
            return
        self._kept, limits = kept, kept.limits
        self._resolution = None
        if limits is None:
            for lower, upper in (self._bounds[:2], self._bounds[2:]):
                lower[:], upper[:] = -np.inf, np.inf
            return
        # To where the kernels read them.
        self._efforts[0], self._efforts[1] = limits.effort, limits.effort_rate
        for own, new in zip(self._motion, limits.motion, strict=True):
            own[:] = new
        self._find_window()

    def _find_window(self) -> None:
        """Write the range of the next effort."""
        if self._kept.rate and self._sent[-1] > 0.0:
            assert self._window is not None
            self._window()
        elif self._kept.limits is not None:
            self._tau_lower[:] = -self._kept.limits.effort
            self._tau_upper[:] = self._kept.limits.effort

    def support(self, contacts: Sequence[PlannedContact]) -> Support:
        """Return the forces that these contacts can exert; with no contacts, none."""
        if not contacts:
            return self._no_support
        return Support(contacts, self._robot, self._weight)

    def prepare(
        self, state: RobotState, resolution: Resolution, support: Support
    ) -> None:
        """Compile what a limited step calls, now instead of where a limit binds."""
        last = self._kept
        for kept, _ in self._all:
            self.enforce(kept)
            limited = kept.limits is not None or support.size
            if limited and resolution not in kept.steps:
                step = self._limited_step(state, resolution, support, 0)
                step.prepare(resolution.acceleration, state.effort)
                self._limit_if_violated(state, resolution, support)
            if kept.limits is not None:
                self._held.prepare(state.v, resolution.acceleration)
        self.enforce(last)

    def applied(self, state: RobotState, tau: Array, period: float) -> None:
        """Record the effort that is sent now: its rate and the speed are limited."""
        self.period = period
        if not self._limits_anything:
            return
        self._held.sent(state.t, state.v, self.delivered, period)
        if self._rate_limited:
            self._sent[:-1], self._sent[-1] = tau, period
            self._find_window()

    def sending(self, state: RobotState, a: Array) -> list[Callable[[float], Any]]:
        """Return calls of the time that do what `applied` does of the effort M a + N.

        The period is that of the last `applied`.
        """
        if not self._limits_anything:
            return []
        calls = [self._held.expect(state.v, a)]
        if self._rate_limited:
            assert self._window is not None
            calls += in_order([bind(_keep, state.effort, self._sent), self._window])
        return calls

    def disturbed(self, acceleration: Array) -> None:
        """Expect an acceleration that something else than the efforts causes, (nv,)."""
        self._held.held.disturbance[:] = acceleration

    def forget(self) -> None:
        """Forget the last efforts: the rate limit does not apply to the next one."""
        self.period = self._sent[-1] = 0.0
        self._held.forget()
        self._find_window()

    def memory(self) -> tuple[Array, ...]:
        """Return a copy of the memory of the last effort."""
        return self._sent.copy(), *self._held.memory()

    def remember(self, memory: tuple[Array, ...]) -> None:
        """Set the memory that `memory` returned."""
        self._sent[:] = memory[0]
        self._held.remember(memory[1:])
        self._find_window()

    def deliver(
        self,
        state: RobotState,
        a: Array,
        violated: int,
        resolution: Resolution,
        support: Support,
        offset: Array | None = None,
    ) -> Delivered:
        """Return efforts and forces for the acceleration nearest to the law's."""
        violated //= FLAGS
        wanted = state.effort  # M a + N
        unsupported = self.is_direct(support)
        if offset is None and unsupported:
            if not violated:
                return wanted, a, self._no_forces, EXACT, 0.0
            return self._limit(state, wanted, a, False, resolution, support, _NO_ROWS)
        motion_ok, effort_ok = violated in (0, EFFORT), violated in (0, MOTION)
        if offset is not None:
            wanted = wanted + offset
            effort_ok = within(wanted, self._tau_lower, self._tau_upper)
        forces, tau = self._no_forces, wanted
        if unsupported and motion_ok and effort_ok:
            return wanted, a, forces, EXACT, 0.0
        if support.size:
            support.update(state, resolution)
            forces, tau = support.minimum_norm_forces(self.base, wanted)
        barriers = self._barriers(state, support)
        for A, least in barriers.values():
            motion_ok = motion_ok and bool((A @ a >= least).all())
        forces_ok = not support.size or support.permits(forces)
        if motion_ok and forces_ok and self._permits.get(tau)():
            if self._floating and not support.size:
                tau[self.base] = 0.0
            return tau, a, forces, EXACT, 0.0
        return self._limit(state, wanted, a, motion_ok, resolution, support, barriers)

    def checks(
        self, state: RobotState, a: Array, resolution: Resolution, support: Support
    ) -> list[Callable[[float], Any]]:
        """Return the calls of the time that write M a + N, and compare with the bounds.

        The last one returns a sum, see `CODES`: 0 if the law is exact and a and the
        effort without contacts are within their bounds. If they are not, and a QP is
        all that is needed then, it is solved at once; `limited` has the result.
        """
        calls = self._compile_checks(state, a, resolution.code)
        limit = self._limit_if_violated(state, resolution, support)
        if limit is None:
            return calls
        step = self._step_of(state, resolution, support)
        self.limited = *step.result, LIMITED, 0.0
        return [*calls, *in_order([limit])]

    def _limit_if_violated(
        self, state: RobotState, resolution: Resolution, support: Support
    ) -> Callable[[], float] | None:
        """Return the call that solves the QP if a bound is violated."""
        # It is None where a step may need more: forces, or barriers.
        if self._kept.limits is None or not self.is_direct(support):
            return None
        step = self._step_of(state, resolution, support)
        return step.nearest_if(resolution.acceleration, state.effort, self._found)

    def violated(self, state: RobotState, a: Array, code: Indices) -> int:
        """Write M a + N and the bounds on a; return which of them are violated."""
        # See `checks` for arguments and result, which is without the law's code.
        # By identity: the calls keep these arrays alive.
        key = id(a), id(code), self._kept.limits is None
        if key not in self._checks:
            self._checks[key] = self._compile_checks(state, a, code)
        value = 0.0
        for call in self._checks[key]:
            value = call(state.t)
        return int(value) % CODES

    def _bind_permits(self, tau: Array) -> Callable[[], float]:
        """Return a call that says whether this effort, (nv,), is within its bounds."""
        return bind(within, tau, self._tau_lower, self._tau_upper)

    def _compile_checks(
        self, state: RobotState, a: Array, code: Indices
    ) -> list[Callable[[float], Any]]:
        """Return the calls of `checks` that solve nothing."""
        check = (
            bind(_unlimited, code, timed=True)
            if self._kept.limits is None
            else bind(
                _check,
                state.q,
                state.v,
                a,
                state.effort,
                self._robot.dof_indices,
                self._motion,
                self._held.held,
                self._bounds,
                code,
                self._found,
                timed=True,
            )
        )
        return [*in_order([state.bind_inverse_dynamics(a)]), check]

    def _barriers(self, state: RobotState, support: Support) -> Barriers:
        """Return the rows A a ≥ lower for distances and static efforts, by kind."""
        limits = self._kept.limits
        found: dict[str, tuple[Array, Array]] = {}
        if limits is None:
            return found
        if limits.distances:
            parts = [each.rows(state, limits.bandwidth) for each in limits.distances]
            A, lower = (np.concatenate(each) for each in zip(*parts, strict=True))
            found["distances"] = A, lower
        if limits.static_effort is not None:
            found["holding"] = limits.static_effort.rows(
                state, limits.bandwidth, support.supporting_dofs
            )
        return found

    def _limit(
        self,
        state: RobotState,
        wanted: Array,
        a: Array,
        redistribute: bool,
        resolution: Resolution,
        support: Support,
        barriers: Barriers,
    ) -> Delivered:
        """Return the nearest to what the law wants within the limits."""
        step = self._step
        if step is None or resolution is not self._resolution:
            step = self._step_of(state, resolution, support)
            self._step, self._resolution = step, resolution
        if barriers:
            count = sum(len(least) for _, least in barriers.values())
            if count > step.capacity:
                step = self._limited_step(state, resolution, support, count)
                self._step = step
        effort = wanted
        if wanted is not state.effort:  # a sum, made anew in each step
            effort = self._effort
            effort[:] = wanted
        status, relaxation = step.solve(a, effort, redistribute, barriers)
        if status is None:  # the solver failed: the efforts stay within their limits
            tau = np.clip(
                wanted - support.map @ support.forces, self._tau_lower, self._tau_upper
            )
            tau[self.base] = 0.0
            return tau, a, support.forces, Status.RELAXED, np.inf
        tau, acceleration, forces = step.result
        if redistribute and status is Status.REDISTRIBUTED:
            acceleration = a
        return tau, acceleration, forces, status, relaxation

    def _step_of(
        self, state: RobotState, resolution: Resolution, support: Support
    ) -> LimitedStep:
        """Return the QP of a stack of tasks, made now if there is none."""
        found = self._kept.steps.get(resolution)
        return found or self._limited_step(state, resolution, support, 0)

    def _limited_step(
        self, state: RobotState, resolution: Resolution, support: Support, count: int
    ) -> LimitedStep:
        """Return the QP of a stack of tasks, with room for so many rows of barriers."""
        motors, (limits, steps, *_) = self._motors, self._kept
        some = np.zeros(self._robot.nv, dtype=bool)
        if limits is not None:
            some = np.isfinite(limits.effort) | np.isfinite(limits.effort_rate)
        steps[resolution] = LimitedStep(
            state,
            resolution,
            support,
            self._bounds,
            self.base,
            motors[some[motors]],
            self._weight,
            1 << (count - 1).bit_length() if count else 0,
        )
        return steps[resolution]


@kernel
def _unlimited(code: Indices, t: float) -> int:
    """Return that nothing is violated, with the law's code."""
    return int(CODES * code[0])


@kernel
def _check(
    q: Array,
    v: Array,
    a: Array,
    tau: Array,
    where: Indices,
    limits: MotionLimits,
    held: Held,
    bounds: Bounds,
    code: Indices,
    found: Array,
    t: float,
) -> float:
    """Observe the last period's effort, and return which limits the next violates."""
    # And the law's code, see `CODES`; `observe` and `violated_limits`. It writes what
    # it returns, and the flags, to ``found``.
    observe(v, held, t)
    flags = violated_limits(
        q,
        v,
        a,
        tau,
        where,
        limits,
        held.error,
        held.drift,
        held.steady,
        held.disturbance,
        bounds,
    )
    found[0], found[1] = CODES * code[0] + FLAGS * flags, flags
    return float(found[0])


@kernel
def _keep(effort: Array, sent: Array) -> None:
    """Keep an effort, (nv,), as the last one that was sent, see `effort_window`."""
    for i in range(effort.shape[0]):
        sent[i] = effort[i]
