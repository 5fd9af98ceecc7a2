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

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.control.actuation.delivered import (
    CarriedStep,
    Delivered,
    DeliveredAlone,
    Kept,
)
from hsp_control.control.actuation.limit_checks import LimitChecks
from hsp_control.control.actuation.limited_step import (
    BEYOND,
    EXACT,
    LIMITED,
    Barriers,
    LimitedStep,
    QPOutcome,
    Status,
)
from hsp_control.control.actuation.limits_in_force import LimitSet
from hsp_control.control.actuation.support import Support
from hsp_control.edge import BoundLaw
from hsp_control.edge.excess import Permitted, Wanted
from hsp_control.engine.plans import AnyCall, PartCall, PartCalls
from hsp_control.robot import RobotState


class Actuation:
    """Computes efforts and contact forces for one law, within one set of limits."""

    def __init__(
        self, state: RobotState, law: BoundLaw, support: Support, limits: LimitSet
    ) -> None:
        """Bind the calls of every step, also with an active limit."""
        nv = state.robot.nv
        self._state, self._law = state, law
        self._support, self._limits = support, limits
        base = support.base
        self._wanted = wanted = Wanted(state.mass_matrix, np.zeros(nv), np.zeros(nv))
        self._qp_outcome = QPOutcome.allocate()
        self._limit_checks = checks = LimitChecks(
            state, limits, wanted.acceleration, self._qp_outcome
        )
        self.outcome, self._rows = checks.outcome, checks.rows
        # Whether the effort is M a + N if it and a are within the bounds.
        self.direct = checks.compiled and not base.size and not support.size
        # the result there for the law's own acceleration
        self.own = Delivered(state.effort, law.acceleration, np.zeros(0), EXACT, 0.0)
        self.nearest = self.own
        # whether `nearest` is delivered with its status, shape (1,)
        self.is_nearest: Indices = np.zeros(1, dtype=np.int64)
        self._checks: PartCalls = [
            state.rnea(wanted.acceleration),
            *checks.calls(support.supporting_dofs),
        ]
        self._check_wanted = engine.Plan(state.plan(self._checks).steps())
        self._tau = support.tau if support.size else wanted.effort
        self._effort_within = self._within_bounds(wanted.effort)
        self._tau_within = self._within_bounds(self._tau)
        self._qp: LimitedStep | None = None
        if limits.limits is not None or support.size:
            holding = self._rows.get("holding")
            self._qp = self._limited_step(0 if holding is None else len(holding.least))
            # the result where the QP was solved at once
            self.nearest = Delivered(*self._qp.result, LIMITED, 0.0)
        # the calls' results with active contacts; None: Python computes them
        self.carried: CarriedStep | None = None
        if support.size:
            support.bind(law)
            at_once = checks.compiled and "barriers" not in self._rows
            self.carried = CarriedStep(self._qp) if self._qp and at_once else None

    def _within_bounds(self, effort: Array) -> Callable[[], float]:
        """Return the call that checks whether an effort is within its bounds."""
        bounds = self._limits.bounds
        call = PartCall(
            engine.Within, x=effort, lower=bounds.tau_lower, upper=bounds.tau_upper
        )
        return self._state.plan([call]).call()

    @cached_property
    def calls(self) -> list[Callable[[float], Any]]:
        """The calls of the time that deliver the law's own acceleration.

        The last one returns whether it is exact and within the limits: then, where
        `direct`, it is delivered with the effort M a + N. Else the law's outcome and
        `outcome` report the reason. If a QP without forces and distances is all that is
        needed where a bound is violated, it is solved at once; `is_nearest` reports
        whether `nearest` is all that there is to deliver. Where contacts carry,
        the last one returns whether `carried` has an effort.
        """
        law, wanted = self._law.acceleration, self._wanted
        begin = PartCall(engine.Copy, x=law, out=wanted.acceleration)
        calls: PartCalls = [begin, *self._checks]
        if (carried := self.carried) is not None:
            found = self._finding_forces(carried)
            last = self._delivering_forces(carried, carried.delivered, carried.forces)
            return self._state.plan([*calls, *found, last]).steps()
        # There may be hundreds of distances, and unused rows cost time, too.
        if self._qp is not None and self.direct and "barriers" not in self._rows:
            keep = PartCall(engine.Copy, x=self._state.effort, out=wanted.effort)
            given = self.outcome.violated, [keep], self._rows
            calls = [*calls, self._qp.nearest_if(*given)]
        plain = PartCall(
            engine.IsPlain,
            law=self._law.outcome,
            limits=self.outcome,
            qp=self._qp_outcome,
            limited=int(LIMITED),
            nearest=self.is_nearest,
        )
        calls = [*calls, plain]
        return self._state.plan(calls).steps()

    def keeping(
        self, acceleration: Array, effort: Array, forces: Array, kept: Kept
    ) -> PartCall:
        """Return the call that keeps the delivered effort, after `calls`.

        Args:
            acceleration: Where it writes the acceleration, shape (nv,).
            effort: Where it writes the effort, shape (nv,) [N·m or N].
            forces: Where it writes the forces of contacts, shape (p,) [N].
            kept: Where it writes which it is.
        """
        if self.carried is not None:
            alone = DeliveredAlone(acceleration, effort, kept.status, kept.which)
            return self._delivering_forces(self.carried, alone, forces)
        return PartCall(
            engine.KeepPart,
            law=self._law.outcome,
            limits=self.outcome,
            nearest=self.is_nearest,
            own_acceleration=self._law.acceleration,
            own_effort=self._state.effort,
            nearest_acceleration=self.nearest.acceleration,
            nearest_effort=self.nearest.effort,
            acceleration=acceleration,
            effort=effort,
            kept=kept.which,
        )

    def calls_alone(self, delivered: DeliveredAlone) -> PartCalls:
        """Return the calls that follow `calls` in a step without Python.

        They are equivalent to `delivered`.

        Args:
            delivered: Where they write the result.
        """
        if not self.direct:
            return self._calls_with_forces(delivered)
        qp, calls = self._qp, list[AnyCall]()
        if "barriers" in self._rows:  # not among the native calls
            keep = PartCall(engine.Copy, x=self._state.effort, out=self._wanted.effort)
            qp, calls = self._whole_step([keep])
        own = self._law.acceleration, self._state.effort
        return [*calls, self._delivering(qp, *own, delivered)]

    def _calls_with_forces(self, delivered: DeliveredAlone) -> PartCalls:
        """Return the calls of `calls_alone` with active contacts."""
        carried, calls = self.carried, list[AnyCall]()
        if carried is None:  # not among the native calls
            rows = self._limit_checks.count
            carried = CarriedStep(self._limited_step(rows))
            calls = self._finding_forces(carried)
        return [*calls, self._delivering_forces(carried, delivered, carried.forces)]

    def _finding_forces(self, carried: CarriedStep) -> list[AnyCall]:
        """Return the calls that compute the contact forces, or the nearest step."""
        wanted, support, bounds = self._wanted, self._support, self._limits.bounds
        keep = PartCall(engine.Copy, x=self._state.effort, out=wanted.effort)
        decide = PartCall(
            engine.ForcesWithin,
            limits=self.outcome,
            cone=support.cone,
            forces=support.forces,
            lower=support.lower,
            upper=support.upper,
            tau=self._tau,
            tau_lower=bounds.tau_lower,
            tau_upper=bounds.tau_upper,
            exact=carried.exact,
            redistribute=carried.redistribute,
            nearest=carried.nearest,
        )
        solved = carried.qp.solved_if(carried.redistribute, carried.nearest, self._rows)
        return [keep, *support.calls(wanted.effort, self._law), decide, *solved]

    def _delivering_forces(
        self, carried: CarriedStep, delivered: DeliveredAlone, forces: Array
    ) -> PartCall:
        """Return the call that selects the delivered effort with active contacts."""
        bounds, result = self._limits.bounds, carried.qp.result
        return PartCall(
            engine.DeliverWithForces,
            law=self._law.outcome,
            limits=self.outcome,
            qp=self._qp_outcome,
            exact=carried.exact,
            redistribute=carried.redistribute,
            acceleration=self._law.acceleration,
            effort=self._tau,
            forces=self._support.forces,
            nearest_acceleration=result.acceleration,
            nearest_effort=result.effort,
            nearest_forces=result.forces,
            base=self._support.base,
            lower=bounds.tau_lower,
            upper=bounds.tau_upper,
            redistributed=int(Status.REDISTRIBUTED),
            relaxed=int(Status.RELAXED),
            beyond=int(BEYOND),
            f=forces,
            **delivered._asdict(),
        )

    def calls_with_offset(
        self, a: Array, offset: Array, delivered: DeliveredAlone
    ) -> PartCalls:
        """Return the calls equivalent to `deliver`, where the effort is `direct`.

        Args:
            a: The acceleration, shape (nv,).
            offset: Effort besides M a + N, shape (nv,).
            delivered: Where they write the result.
        """
        wanted, bounds = self._wanted, self._limits.bounds
        begin = PartCall(engine.Copy, x=a, out=wanted.acceleration)
        add = PartCall(
            engine.OffsetEffort,
            effort=self._state.effort,
            offset=offset,
            lower=bounds.tau_lower,
            upper=bounds.tau_upper,
            wanted=wanted.effort,
            limits=self.outcome,
        )
        qp, calls = self._whole_step([])
        deliver = self._delivering(qp, a, wanted.effort, delivered)
        return [begin, *self._checks, add, *calls, deliver]

    def _whole_step(
        self, before: PartCalls
    ) -> tuple[LimitedStep | None, list[AnyCall]]:
        """Return a QP with room for all rows, and the calls that solve it if needed."""
        if self._qp is None:
            return None, []
        qp = self._limited_step(self._limit_checks.count)
        return qp, [qp.nearest_if(self.outcome.violated, before, self._rows)]

    def _delivering(
        self,
        qp: LimitedStep | None,
        a: Array,
        effort: Array,
        delivered: DeliveredAlone,
    ) -> PartCall:
        """Return the call that selects the delivered effort."""
        nearest = self.own if qp is None else qp.result
        return PartCall(
            engine.Deliver,
            law=self._law.outcome,
            limits=self.outcome,
            qp=self._qp_outcome,
            acceleration=a,
            effort=effort,
            nearest_acceleration=nearest.acceleration,
            nearest_effort=nearest.effort,
            wanted=self._wanted.effort,
            lower=self._limits.bounds.tau_lower,
            upper=self._limits.bounds.tau_upper,
            relaxed=int(Status.RELAXED),
            beyond=int(BEYOND),
            **delivered._asdict(),
        )

    def deliver(self, a: Array, offset: Array | None = None) -> Delivered:
        """Return efforts and forces for the acceleration that is nearest to a.

        Args:
            a: The acceleration, shape (nv,).
            offset: Effort besides M a + N, shape (nv,); None: none.
        """
        self._wanted.acceleration[:] = a
        self._check_wanted(self._state.t)
        return self._delivered(a, offset)

    def delivered(self, a: Array) -> Delivered:
        """Return the effort for the law's acceleration a (nv,), after `calls`."""
        if self.carried is None:
            return self._delivered(a, None)
        return self.carried.result(a, self._qp_outcome)

    @property
    def relaxation(self) -> float:
        """The largest violation of a relaxed limit, with active contacts."""
        if self.carried is None:
            return 0.0
        return self.carried.relaxation(self._qp_outcome)

    def _delivered(self, a: Array, offset: Array | None) -> Delivered:
        delivered = self._within_limits(a, offset)
        if self.outcome.beyond.item():
            return delivered._replace(status=BEYOND)
        return delivered

    def _within_limits(self, a: Array, offset: Array | None) -> Delivered:
        """Return the result, whether or not a joint is beyond a limit."""
        found = self.outcome
        if self._qp and self.direct and not self._qp_outcome.unsolved.item():
            status, relaxation = self._qp.found()
            own = self.nearest  # not `_replace`: see `BoundMixture.make`
            return Delivered(
                own.effort, own.acceleration, own.forces, status, relaxation
            )
        if self.direct and not found.violated.item() and offset is None:
            return Delivered(self._state.effort, a, self.own.forces, EXACT, 0.0)
        motion_ok = not (found.motion.item() or found.rows.item())
        effort_ok = not found.effort.item()
        # A QP that was tried at once has overwritten the unlimited effort.
        wanted, support = self._wanted.effort, self._support
        self._wanted.acceleration[:], wanted[:] = a, self._state.effort
        if offset is not None:
            wanted += offset
            effort_ok = bool(self._effort_within())
        elif self.direct:
            return self._nearest(a, False, self._limit_checks.barriers())
        forces, tau = self.own.forces, self._tau
        if self.direct and motion_ok and effort_ok:
            return Delivered(tau, a, forces, EXACT, 0.0)
        if support.size:
            support.update(self._law)
            forces = support.minimum_norm_forces(wanted)
        barriers = self._limit_checks.barriers()
        for A, least in barriers.values():
            motion_ok = motion_ok and bool((A @ a >= least).all())
        forces_ok = not support.size or support.permits()
        if motion_ok and forces_ok and self._tau_within():
            tau[support.base] = 0.0
            return Delivered(tau, a, forces, EXACT, 0.0)
        return self._nearest(a, motion_ok, barriers)

    def rehearse(self) -> None:
        """Solve the QP again, to fill caches; the result is unused."""
        if self._qp is not None:
            self._qp.solve(False, {})

    def _nearest(self, a: Array, redistribute: bool, barriers: Barriers) -> Delivered:
        """Return the nearest to the law's command within the limits."""
        count = sum(len(least) for _, least in barriers.values())
        if self._qp is None or count > self._qp.capacity:
            self._qp = self._limited_step(count)
        status, relaxation = self._qp.solve(redistribute, barriers)
        if status is None:  # the solver failed: the efforts stay within their limits
            support, bounds = self._support, self._limits.bounds
            tau = np.clip(self._tau, bounds.tau_lower, bounds.tau_upper)
            tau[support.base] = 0.0
            return Delivered(tau, a, support.forces, Status.RELAXED, np.inf)
        tau, acceleration, forces = self._qp.result
        if redistribute and status is Status.REDISTRIBUTED:
            acceleration = a
        return Delivered(tau, acceleration, forces, status, relaxation)

    def _limited_step(self, count: int) -> LimitedStep:
        """Return the QP, with memory for a number of rows of barriers."""
        limits, nv = self._limits.limits, self._state.robot.nv
        some = np.zeros(nv, dtype=bool)
        if limits is not None:
            some = np.isfinite(limits.effort) | np.isfinite(limits.effort_rate)
        motors = np.delete(np.arange(nv), self._support.base)
        capacity = 1 << (count - 1).bit_length() if count else 0
        permitted = None
        if limits is not None and not self._support.base.size:
            motion = self._limits.motion
            permitted = Permitted.by(
                limits.effort,
                motion.upper - motion.lower,
                motion.velocity,
                motion.acceleration,
                motion.bandwidth[0],
            )
        law = self._state, self._law, self._support, self._limits.bounds, self._wanted
        return LimitedStep(
            *law, motors[some[motors]], self._qp_outcome, capacity, permitted
        )
