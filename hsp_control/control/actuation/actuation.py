"""From the law's acceleration to efforts and contact forces within the limits.

Minimise ½ δᵀH δ over a = a* + δ, with a* the law's acceleration and

    H = Σ ρ_k N_k N_kᵀ,      ρ_1 = 1 > ρ_2 > ... > ρ_N

in whitened coordinates, N_k the directions of the tasks of level k in the null space of
those above, and ρ_N the cost of motion in the null space of all tasks. So the null
space deviates first, then the tasks, the lowest priority first. The constraints are
affine in (δ, f):

    effort      |M a + N - F f| ≤ limits, and within the rate limit of the last effort
    base        (M a + N - F f)_base = 0                          no motor acts there
    contacts    J_c δ = 0, f within friction cones
    motion      bounds on a from position, velocity and acceleration limits
    distances   ∇d·a ≥ the bound from the barriers of `MinimumDistance`
    holding     ∇G·a ≤ the bound from the barriers of `StaticEffort`
    null space  |P δ| ≤ λ s, see `null_space_rows`

If a* violates no constraint it is the optimum, and no QP is solved. ``docs/law.md``,
Contacts and floating bases, and Limits.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.native import bind
from hsp_control.constraints.limits.acceleration_bounds import (
    EFFORT,
    MOTION,
    Bounds,
    violated_limits,
    within,
)
from hsp_control.control.actuation.deviation_cost import deviation_cost, null_space_rows
from hsp_control.control.actuation.qp import Rows, solve, stacked
from hsp_control.control.actuation.status import EXACT, Status
from hsp_control.control.actuation.support import Support
from hsp_control.control.planned_contact import PlannedContact
from hsp_control.control.planned_limits import PlannedLimits
from hsp_control.law import Resolution
from hsp_control.robot import Robot, RobotState

_FORCE_COST = 1e-6
"""Cost of squared forces, in robot weights, relative to accelerations. It makes the
forces unique. With 1e-8 and less the solver reports Talos' QPs as infeasible."""
_RELAXATION_COST = {
    "contacts": 1e3,
    "distances": 30.0,
    "motion": 1.0,
    "holding": 0.1,
    "null space": 1.0,
}
"""Cost of a violation, where limits contradict each other: the most expensive kind is
relaxed last. The bound of the null space is relaxed by itself, before all others."""
_REGULARISATION, _ROUNDS = 1e-4, 4
"""Cost of all other unknowns while the violation is minimised, and the number of
rounds. Each round penalises the difference from the result of the round before, so that
this cost fades. Otherwise 1e3 rad/s², which a far target requires, would outweigh a
violation."""


Delivered = tuple[Array, Array, Array, Status, float]
"""What the actuation delivers: effort, shape (nv,) [N·m or N], zero where there is no
motor; acceleration, shape (nv,); contact forces in the axes of each contact, shape
(size,) [N]; the `Status`; and the largest violation of a relaxed limit [rad/s² or
m/s²]."""


class Actuation:
    """Computes efforts and contact forces for accelerations, within limits.

    Its only memory is the last effort, used where the effort rate is limited: see
    `applied`.

    Attributes:
        limits: The limits in force, if any.
        base: Indices of the degrees of freedom without a motor.
    """

    def __init__(
        self, robot: Robot, planned: PlannedLimits, base: Sequence[int] = ()
    ) -> None:
        """Allocate.

        Args:
            robot: The robot.
            planned: Its limits.
            base: Indices of the degrees of freedom without a motor.
        """
        nv = robot.nv
        self._robot = robot
        self.base: Indices = np.array(base, dtype=np.int64)
        self._floating = bool(self.base.size)
        self._motors: Indices = np.setdiff1d(np.arange(nv), self.base)
        self._mass = sum(inertia.mass for inertia in robot.model.inertias)
        self._weight = 9.81 * self._mass
        self._a_lower, self._a_upper = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._tau_lower, self._tau_upper = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._no_forces = np.zeros(0)
        self._no_support = Support((), robot, self._weight)
        self.plan(planned, -np.inf)
        self.forget()

    def plan(self, planned: PlannedLimits, t: float) -> None:
        """Keep other limits from now on; t is the present time [s]."""
        self._planned = planned
        self.limits = planned.at(t, self._robot)
        self._check = IdentityCache(self._compile_check)  # it reads their arrays
        self._slacks = planned.slacks(t)
        if self.limits is not None and not np.isfinite(self.limits.effort_rate).any():
            self.forget()
        self._only_box_limits = not (
            self._floating
            or planned.distances
            or any(each.static_effort for each in planned.sets if each is not None)
        )

    def update_limits(self, t: float) -> None:
        """Compute the limits in force at time t [s], if they change."""
        if self._planned.numbers.constant:
            return
        now, memory = self._planned.at(t, self._robot), self.limits
        assert now is not None
        assert memory is not None
        for name in ("effort", "effort_rate", "velocity", "lower", "upper"):
            np.copyto(getattr(memory, name), getattr(now, name))
        for old, new in zip(memory.motion, now.motion, strict=True):
            np.copyto(old, new)
        self.limits = replace(
            memory,
            static_effort=now.static_effort,
            null_space_speed=now.null_space_speed,
        )
        self._slacks = self._planned.slacks(t)
        if not np.isfinite(now.effort_rate).any():
            self.forget()

    def support(self, contacts: Sequence[PlannedContact]) -> Support:
        """Return the forces that these contacts can exert; with no contacts, none."""
        if not contacts:
            return self._no_support
        return Support(contacts, self._robot, self._weight)

    def applied(self, tau: Array, period: float) -> None:
        """Record the effort that is sent now, for the limit on the effort rate.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time until the next effort [s].
        """
        if self.limits is None or not np.isfinite(self.limits.effort_rate).any():
            return
        step = self.limits.effort_rate * period
        np.maximum(-self.limits.effort, tau - step, out=self._tau_lower)
        np.minimum(self.limits.effort, tau + step, out=self._tau_upper)
        # An earlier effort may lie outside the limits: then move towards them.
        np.minimum(self._tau_lower, self.limits.effort, out=self._tau_lower)
        np.maximum(self._tau_upper, -self.limits.effort, out=self._tau_upper)

    def forget(self) -> None:
        """Forget the last effort: the rate limit does not apply to the next one."""
        if self.limits is not None:
            self._tau_lower[:] = -self.limits.effort
            self._tau_upper[:] = self.limits.effort

    def memory(self) -> tuple[Array, Array]:
        """Return a copy of the memory of the last effort."""
        return self._tau_lower.copy(), self._tau_upper.copy()

    def remember(self, memory: tuple[Array, Array]) -> None:
        """Set the memory that `memory` returned."""
        self._tau_lower[:], self._tau_upper[:] = memory

    def deliver(
        self,
        state: RobotState,
        a: Array,
        resolution: Resolution,
        support: Support,
        offset: Array | None = None,
    ) -> Delivered:
        """Return efforts and forces for the acceleration nearest to the law's.

        Args:
            state: The robot's state.
            a: The law's acceleration, shape (nv,).
            resolution: The resolved law, with its levels in order of priority.
            support: The forces of the active contacts; updated here.
            offset: Effort besides M a + N, for friction for example, shape (nv,)
                [N·m or N]; None: none. The limits hold for the sum.
        """
        wanted = state.inverse_dynamics(a)  # M a + N
        violated = 0.0 if self.limits is None else self._check.get(state, a)()
        if not violated and offset is None and self._only_box_limits:
            return wanted, a, self._no_forces, EXACT, 0.0
        motion_ok, effort_ok = violated in (0, EFFORT), violated in (0, MOTION)
        if offset is not None:
            wanted = wanted + offset
            effort_ok = within(wanted, self._tau_lower, self._tau_upper)
        forces, tau = self._no_forces, wanted
        if self._only_box_limits and motion_ok and effort_ok:
            return wanted, a, forces, EXACT, 0.0
        if support.size:
            support.update(state)
            forces, tau = support.minimum_norm_forces(self.base, wanted)
        barriers = self._barriers(state, support)
        for rows in barriers.values():
            motion_ok = motion_ok and bool((rows.A @ a >= rows.lower).all())
        forces_ok = not support.size or support.permits(forces)
        if motion_ok and forces_ok and within(tau, self._tau_lower, self._tau_upper):
            if self._floating:
                tau[self.base] = 0.0
            return tau, a, forces, EXACT, 0.0
        if motion_ok and support.size:
            shared = self._redistribute(wanted, forces, support)
            if shared is not None:
                return self._finish(
                    wanted, a, shared, support, Status.REDISTRIBUTED, 0.0
                )
        return self._limit(state, wanted, a, forces, resolution, support, barriers)

    def _compile_check(self, state: RobotState, a: Array) -> Callable[[], float]:
        """Return the call that writes the bounds on the acceleration.

        It returns 0, `MOTION` if a violates its bounds, `EFFORT` if the effort without
        contacts does (read from Pinocchio's data), or the sum of both.
        """
        assert self.limits is not None
        return bind(
            violated_limits,
            state.q,
            state.v,
            a,
            state.data.tau,
            self._robot.dof_indices,
            self.limits.motion,
            Bounds(self._a_lower, self._a_upper, self._tau_lower, self._tau_upper),
        )

    def _barriers(self, state: RobotState, support: Support) -> dict[str, Rows]:
        """Return the rows A a ≥ lower for distances and static efforts, by kind."""
        limits = self.limits
        found: dict[str, Rows] = {}
        if limits is None:
            return found
        if self._slacks:
            parts = [each.rows(state, limits.bandwidth) for each, _ in self._slacks]
            slack = [
                s
                for (_, lower), (_, s) in zip(parts, self._slacks, strict=True)
                for _ in lower
            ]
            A, lower = (np.concatenate(each) for each in zip(*parts, strict=True))
            lower = lower - np.array(slack)
            found["distances"] = Rows(A, lower, np.full(len(lower), np.inf))
        if limits.static_effort is not None:
            A, lower = limits.static_effort.rows(
                state, limits.bandwidth, support.supporting_dofs
            )
            found["holding"] = Rows(A, lower, np.full(len(lower), np.inf))
        return found

    def _redistribute(
        self, wanted: Array, forces: Array, support: Support
    ) -> Array | None:
        """Return permitted forces nearest to the given ones, for the same acceleration.

        None if there are none.
        """
        scale, base = self._weight, self.base
        H = np.diag(1.0 / np.maximum(support.inverse_cost, 1e-6))
        rows = stacked(
            self._base_rows(support.map[base] * scale, wanted[base]),
            *self._force_rows(support),
            self._effort_rows(-support.map * scale, wanted),
        )
        x = solve(H, -H @ (forces / scale), rows)
        return None if x is None else x * scale

    def _limit(
        self,
        state: RobotState,
        wanted: Array,
        a: Array,
        forces: Array,
        resolution: Resolution,
        support: Support,
        barriers: Mapping[str, Rows],
    ) -> Delivered:
        """Solve for the acceleration nearest to the law's within the limits."""
        n, p, scale = len(a), support.size, self._weight
        M, F = state.mass_matrix, support.map * scale
        limits = self.limits
        weight = None if limits is None else limits.null_space_weight
        deviation = deviation_cost(resolution, len(support.contacts) > 0, weight)
        H = np.zeros((n + p, n + p))
        H[:n, :n] = deviation.metric
        # Small beside the cost of any deviation: see _FORCE_COST.
        cost = _FORCE_COST / np.maximum(support.inverse_cost, 1e-6)
        H[range(n, n + p), range(n, n + p)] = cost
        f = np.zeros(n + p)
        f[n:] = -cost * (forces / scale)

        base, effort_map = self.base, np.hstack([M, -F])
        hard, soft = [self._effort_rows(effort_map, wanted)], {}
        if base.size:
            hard.append(self._base_rows(-effort_map[base], wanted[base]))
        if p:
            hard += [_padded(rows, n, 0) for rows in self._force_rows(support)]
            soft["contacts"] = self._contact_rows(resolution, support, n + p)
        bounded = np.flatnonzero(
            np.isfinite(self._a_lower) | np.isfinite(self._a_upper)
        )
        unit = np.zeros((len(bounded), n + p))
        unit[np.arange(len(bounded)), bounded] = 1.0
        soft["motion"] = Rows(
            unit, (self._a_lower - a)[bounded], (self._a_upper - a)[bounded]
        )
        for kind, rows in barriers.items():
            padded = _padded(rows, 0, p)
            soft[kind] = padded._replace(lower=rows.lower - rows.A @ a)
        kept = stacked(*hard, *soft.values())
        bound = None
        if limits is not None and limits.null_space_speed is not None:
            speed = limits.null_space_speed
            bound = null_space_rows(resolution, deviation.projector, speed, n + p)
        x = _nearest(H, f, kept, bound)
        status, relaxation = Status.LIMITED, 0.0
        if x is None:
            relaxed, closest, relaxation = _relax(stacked(*hard), soft)
            x = _nearest(H, f, stacked(*hard, relaxed), bound)
            x = closest if x is None else x
            status = Status.RELAXED
        if x is None:  # the solver failed: the efforts stay within their limits
            tau = np.clip(
                wanted - support.map @ forces, self._tau_lower, self._tau_upper
            )
            tau[base] = 0.0
            return tau, a, forces, Status.RELAXED, np.inf
        wanted = wanted + M @ x[:n]
        return self._finish(
            wanted, a + x[:n], x[n:] * scale, support, status, relaxation
        )

    def _finish(
        self,
        wanted: Array,
        a: Array,
        forces: Array,
        support: Support,
        status: Status,
        relaxation: float,
    ) -> Delivered:
        """Return the efforts for forces, without the solver's violations of 1e-9."""
        forces = np.clip(forces, support.lower, support.upper)
        tau = np.clip(wanted - support.map @ forces, self._tau_lower, self._tau_upper)
        tau[self.base] = 0.0
        return tau, a, forces, status, relaxation

    def _base_rows(self, A: Array, wrench: Array) -> Rows:
        """Return the rows A x = wrench, divided by the robot's mass."""
        return Rows(A / self._mass, wrench / self._mass, wrench / self._mass)

    def _effort_rows(self, A: Array, wanted: Array) -> Rows:
        limited = self._motors[
            np.isfinite(self._tau_lower[self._motors])
            | np.isfinite(self._tau_upper[self._motors])
        ]
        return Rows(
            A[limited],
            self._tau_lower[limited] - wanted[limited],
            self._tau_upper[limited] - wanted[limited],
        )

    def _force_rows(self, support: Support) -> tuple[Rows, Rows]:
        """Return the cones and the bounds of the forces, in robot weights."""
        bounded = np.flatnonzero(np.isfinite(support.lower))
        return (
            Rows(
                support.cone,
                np.zeros(len(support.cone)),
                np.full(len(support.cone), np.inf),
            ),
            Rows(
                np.eye(support.size)[bounded],
                support.lower[bounded] / self._weight,
                support.upper[bounded] / self._weight,
            ),
        )

    def _contact_rows(
        self, resolution: Resolution, support: Support, width: int
    ) -> Rows:
        """Return the rows J_c δ = 0."""
        count = sum(contact.rows for contact in support.contacts)
        J = resolution.problem.task.jacobian[:count]
        A = np.zeros((count, width))
        A[:, : J.shape[1]] = J
        return Rows(A, np.zeros(count), np.zeros(count))


def _padded(rows: Rows, before: int, after: int) -> Rows:
    """Return rows with columns of zeros added on both sides."""
    width = rows.A.shape[1]
    A = np.zeros((len(rows.A), before + width + after))
    A[:, before : before + width] = rows.A
    return rows._replace(A=A)


def _nearest(H: Array, f: Array, kept: Rows, bound: Rows | None) -> Array | None:
    """Return the optimum within rows and a bound; the bound is relaxed if needed."""
    if bound is None:
        return solve(H, f, kept)
    x = solve(H, f, stacked(kept, bound))
    if x is None:
        relaxed, closest, _ = _relax(kept, {"null space": bound})
        x = None if closest is None else solve(H, f, stacked(kept, relaxed))
        x = closest if x is None else x
    return x


def _relax(hard: Rows, soft: Mapping[str, Rows]) -> tuple[Rows, Array | None, float]:
    """Relax the soft rows as little as the hard rows permit.

    Contacts are kept longest, then distances, then joint motion, see
    `_RELAXATION_COST`.

    Returns:
        The relaxed rows, an x within them, and the largest violation; or the soft rows,
        None and inf if the solver finds none.
    """
    rows = stacked(*soft.values())
    n, s = hard.A.shape[1], len(rows.A)
    cost = np.concatenate(
        [np.full(len(some.A), _RELAXATION_COST[kind]) for kind, some in soft.items()]
    )
    weights = np.concatenate([np.full(n, _REGULARISATION), cost])
    H, center = np.diag(weights), np.zeros(n + s)
    softened = Rows(np.hstack([rows.A, np.eye(s)]), rows.lower, rows.upper)
    everything = stacked(_padded(hard, 0, s), softened)
    x = None
    for _ in range(_ROUNDS):
        nearer = solve(H, -weights * center, everything)
        if nearer is None:
            break
        x = nearer
        center[:n] = x[:n]
    if x is None:
        return rows, None, np.inf
    reached = rows.A @ x[:n]
    slack = 1e-7 * (1.0 + np.abs(reached))
    relaxed = Rows(
        rows.A,
        np.minimum(rows.lower, reached - slack),
        np.maximum(rows.upper, reached + slack),
    )
    return relaxed, x[:n], float(np.abs(x[n:]).max(initial=0.0))
