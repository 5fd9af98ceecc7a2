"""From the law's acceleration to efforts and contact forces within the limits.

Minimise ½ δᵀH δ over a = a* + δ, with a* the law's acceleration and

    H = Σ ρ_k N_k N_kᵀ,      ρ_1 = 1 > ρ_2 > ... > ρ_N

in whitened coordinates, N_k the directions of the tasks of level k in the null space of
those above, and ρ_N that of the rest: first the null space gives way, then the tasks in
the order of their priority. The rows are affine in (δ, f):

    effort      |M a + N - F f| ≤ limits, and within the effort rate of the last one
    base        (M a + N - F f)_base = 0                          no motor pushes there
    contacts    J_c δ = 0, f within friction cones
    motion      bounds on a from position, velocity and acceleration limits
    distances   ∇d·a ≥ what the barriers of least distances ask for
    holding     ∇G·a ≤ what the barriers of static efforts ask for
    null space  |P δ| ≤ λ s: how far it goes before tasks do

Where a* violates no row it is the optimum, and nothing is solved. ``law.md`` §5, §6.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.native import bind
from hsp_control.constraints.contacts import Contact
from hsp_control.constraints.limits import Limits
from hsp_control.constraints.limits.acceleration_bounds import (
    EFFORT,
    MOTION,
    keeps_limits,
    within,
)
from hsp_control.control.actuation.deviation_cost import deviation_cost, null_space_rows
from hsp_control.control.actuation.qp import Rows, solve, stacked
from hsp_control.control.actuation.status import EXACT, LIMITED, REDISTRIBUTED, RELAXED
from hsp_control.control.actuation.support import Support
from hsp_control.law import Resolution
from hsp_control.robot import Robot, RobotState

_FORCE_COST = 1e-6
"""Of forces in robot weights squared, beside accelerations: it decides what nothing
else does. With 1e-8 and less the solver takes Talos' programmes for infeasible."""
_ORDER = {
    "contacts": 1e3,
    "distances": 30.0,
    "motion": 1.0,
    "holding": 0.1,
    "null space": 1.0,
}
"""What yields last has the greatest cost, where limits contradict each other. The null
space's bound is relaxed alone, before all others."""
_INDIFFERENT, _ROUNDS = 1e-4, 4
"""Cost of all else, while the least violation is looked for; and how often it is
looked for about what the last round found: the cost is of the difference, so it fades.
Else 1e3 rad/s², as a far target asks for, would outweigh a violation."""


Delivered = tuple[Array, Array, Array, int, float]
"""What is done about the law's acceleration: effort, shape (nv,), zero where no motor
is [N·m or N]; acceleration, shape (nv,); forces at the points of the contacts, in their
axes, shape (size,) [N]; `EXACT`, `REDISTRIBUTED`, `LIMITED` or `RELAXED`; and by how
much the worst bound is missed [rad/s² or m/s²]."""


class Actuation:
    """Efforts and contact forces for accelerations, within limits.

    Its one memory is the last effort, and only where the rate of efforts is limited:
    see `applied`.

    Attributes:
        limits: The limits, if any.
        base: The freedoms that no motor moves.
    """

    def __init__(
        self, robot: Robot, limits: Limits | None, base: Sequence[int] = ()
    ) -> None:
        """Allocate.

        Args:
            robot: The robot.
            limits: Its limits; None for none.
            base: The freedoms that no motor moves.
        """
        nv = robot.nv
        self._robot = robot
        self.limits = limits
        self.base: Indices = np.array(base, dtype=np.int64)
        self._floats = bool(self.base.size)
        self._motors: Indices = np.setdiff1d(np.arange(nv), self.base)
        self._mass = sum(inertia.mass for inertia in robot.model.inertias)
        self._weight = 9.81 * self._mass
        self._least, self._greatest = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._low, self._high = np.full(nv, -np.inf), np.full(nv, np.inf)
        self._no_forces = np.zeros(0)
        self._no_support = Support((), nv, self._weight)
        self._bound: tuple[RobotState, Array] | None = None
        self._check: Callable[[], float]
        self._only_boxes = not self._floats and (
            limits is None or not (limits.distances or limits.static_effort)
        )
        self.forget()

    def support(self, contacts: Sequence[Contact]) -> Support:
        """Return what contacts can do; none: nothing."""
        if not contacts:
            return self._no_support
        return Support(contacts, self._robot.nv, self._weight)

    def applied(self, tau: Array, period: float) -> None:
        """Take note of the effort that goes out now and of when the next one will.

        Args:
            tau: Effort, shape (nv,).
            period: Time until the next effort [s].
        """
        if self.limits is None or not np.isfinite(self.limits.effort_rate).any():
            return
        step = self.limits.effort_rate * period
        np.maximum(-self.limits.effort, tau - step, out=self._low)
        np.minimum(self.limits.effort, tau + step, out=self._high)
        # An effort from before the limits may lie outside them: then towards them.
        np.minimum(self._low, self.limits.effort, out=self._low)
        np.maximum(self._high, -self.limits.effort, out=self._high)

    def forget(self) -> None:
        """Forget the last effort: the next one may be any within the limits."""
        if self.limits is not None:
            self._low[:], self._high[:] = -self.limits.effort, self.limits.effort

    def deliver(
        self,
        state: RobotState,
        a: Array,
        resolution: Resolution,
        support: Support,
        offset: Array | None = None,
    ) -> Delivered:
        """Return efforts and forces for an acceleration, or what is nearest to it.

        Args:
            state: The robot's state.
            a: The law's acceleration, shape (nv,).
            resolution: Where it comes from: whose tasks yield in which order.
            support: The contacts that bear; updated here.
            offset: What the acceleration takes besides M a + N, as friction does,
                shape (nv,) [N·m or N]; None: nothing. Limits are kept by the sum.
        """
        wanted = state.inverse_dynamics(a)  # M a + N
        broken = self._broken(state, a)
        moves, affords = broken in (0, EFFORT), broken in (0, MOTION)
        if offset is not None:
            wanted = wanted + offset
            affords = within(wanted, self._low, self._high)
        forces, tau = self._no_forces, wanted
        if self._only_boxes and moves and affords:
            return wanted, a, forces, EXACT, 0.0
        if support.size:
            support.update(state)
            forces, tau = support.least_forces(self.base, wanted)
        barriers = self._barriers(state, support)
        for rows in barriers.values():
            moves = moves and bool((rows.A @ a >= rows.lower).all())
        bears = not support.size or support.bears(forces)
        if moves and bears and within(tau, self._low, self._high):
            if self._floats:
                tau[self.base] = 0.0
            return tau, a, forces, EXACT, 0.0
        if moves and support.size:
            shared = self._redistribute(wanted, forces, support)
            if shared is not None:
                return self._finish(wanted, a, shared, support, REDISTRIBUTED, 0.0)
        return self._limit(state, wanted, a, forces, resolution, support, barriers)

    def _broken(self, state: RobotState, a: Array) -> float:
        """Write the bounds on the acceleration; return what is broken, if anything.

        `MOTION` if a is, `EFFORT` if the effort without contacts is, which Pinocchio's
        data has just been given, or the sum of both.
        """
        limits, bound = self.limits, self._bound
        if limits is None:
            return 0.0
        if bound is None or bound[0] is not state or bound[1] is not a:
            self._bound = state, a
            self._check = bind(
                keeps_limits,
                state.q,
                state.v,
                a,
                state.data.tau,
                self._robot.dof_indices,
                limits.guarded_lower,
                limits.guarded_upper,
                limits.guarded_velocity,
                limits.acceleration,
                limits.bandwidth,
                self._least,
                self._greatest,
                self._low,
                self._high,
            )
        return self._check()

    def _barriers(self, state: RobotState, support: Support) -> dict[str, Rows]:
        """Return the rows A a ≥ lower that keep distances and postures."""
        limits = self.limits
        found: dict[str, Rows] = {}
        if limits is None:
            return found
        if limits.distances:
            parts = [each.rows(state, limits.bandwidth) for each in limits.distances]
            A, lower = (np.concatenate(each) for each in zip(*parts, strict=True))
            found["distances"] = Rows(A, lower, np.full(len(lower), np.inf))
        if limits.static_effort is not None:
            A, lower = limits.static_effort.rows(
                state, limits.bandwidth, support.carrying
            )
            found["holding"] = Rows(A, lower, np.full(len(lower), np.inf))
        return found

    def _redistribute(
        self, wanted: Array, forces: Array, support: Support
    ) -> Array | None:
        """Return other forces for the same acceleration, nearest to the least ones."""
        scale, base = self._weight, self.base
        H = np.diag(1.0 / np.maximum(support.ease, 1e-6))
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
        """Return the acceleration nearest to the law's that the limits permit."""
        n, p, scale = len(a), support.size, self._weight
        M, F = state.mass_matrix, support.map * scale
        limits = self.limits
        weight = None if limits is None else limits.null_space_weight
        order = deviation_cost(resolution, len(support.contacts) > 0, weight)
        H = np.zeros((n + p, n + p))
        H[:n, :n] = order.metric
        # Beside directions that cost nothing else, a force costs next to nothing.
        cost = _FORCE_COST / np.maximum(support.ease, 1e-6)
        H[range(n, n + p), range(n, n + p)] = cost
        f = np.zeros(n + p)
        f[n:] = -cost * (forces / scale)

        base, pushes = self.base, np.hstack([M, -F])
        hard, soft = [self._effort_rows(pushes, wanted)], {}
        if base.size:
            hard.append(self._base_rows(-pushes[base], wanted[base]))
        if p:
            hard += [_padded(rows, n, 0) for rows in self._force_rows(support)]
            soft["contacts"] = self._contact_rows(resolution, support, n + p)
        bounded = np.flatnonzero(np.isfinite(self._least) | np.isfinite(self._greatest))
        unit = np.zeros((len(bounded), n + p))
        unit[np.arange(len(bounded)), bounded] = 1.0
        soft["motion"] = Rows(
            unit, (self._least - a)[bounded], (self._greatest - a)[bounded]
        )
        for kind, rows in barriers.items():
            wide = _padded(rows, 0, p)
            soft[kind] = wide._replace(lower=rows.lower - rows.A @ a)
        kept = stacked(*hard, *soft.values())
        bound = None
        if limits is not None and limits.null_space_speed is not None:
            speed = limits.null_space_speed
            bound = null_space_rows(resolution, order.projector, speed, n + p)
        x = _nearest(H, f, kept, bound)
        status, relaxation = LIMITED, 0.0
        if x is None:
            widened, least, relaxation = _relax(stacked(*hard), soft)
            x = _nearest(H, f, stacked(*hard, widened), bound)
            x = least if x is None else x
            status = RELAXED
        if x is None:  # beyond what the solver can do: still no effort beyond limits
            tau = np.clip(wanted - support.map @ forces, self._low, self._high)
            tau[base] = 0.0
            return tau, a, forces, RELAXED, np.inf
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
        status: int,
        relaxation: float,
    ) -> Delivered:
        """Return the efforts that go with forces; the solver leaves 1e-9 of them."""
        forces = np.clip(forces, support.least, support.greatest)
        tau = np.clip(wanted - support.map @ forces, self._low, self._high)
        tau[self.base] = 0.0
        return tau, a, forces, status, relaxation

    def _base_rows(self, A: Array, wrench: Array) -> Rows:
        """Return rows A x = wrench, per robot mass."""
        return Rows(A / self._mass, wrench / self._mass, wrench / self._mass)

    def _effort_rows(self, A: Array, wanted: Array) -> Rows:
        limited = self._motors[
            np.isfinite(self._low[self._motors]) | np.isfinite(self._high[self._motors])
        ]
        return Rows(
            A[limited],
            self._low[limited] - wanted[limited],
            self._high[limited] - wanted[limited],
        )

    def _force_rows(self, support: Support) -> tuple[Rows, Rows]:
        """Return cones and bounds of forces in robot weights."""
        bounded = np.flatnonzero(np.isfinite(support.least))
        return (
            Rows(
                support.cone,
                np.zeros(len(support.cone)),
                np.full(len(support.cone), np.inf),
            ),
            Rows(
                np.eye(support.size)[bounded],
                support.least[bounded] / self._weight,
                support.greatest[bounded] / self._weight,
            ),
        )

    def _contact_rows(
        self, resolution: Resolution, support: Support, width: int
    ) -> Rows:
        """Return rows J_c δ = 0."""
        count = sum(contact.rows for contact in support.contacts)
        J = resolution.problem.task.jacobian[:count]
        A = np.zeros((count, width))
        A[:, : J.shape[1]] = J
        return Rows(A, np.zeros(count), np.zeros(count))


def _padded(rows: Rows, before: int, after: int) -> Rows:
    """Return rows with columns of zeros on either side."""
    width = rows.A.shape[1]
    A = np.zeros((len(rows.A), before + width + after))
    A[:, before : before + width] = rows.A
    return rows._replace(A=A)


def _nearest(H: Array, f: Array, kept: Rows, bound: Rows | None) -> Array | None:
    """Return the optimum within rows and a bound, which is widened where it must be."""
    if bound is None:
        return solve(H, f, kept)
    x = solve(H, f, stacked(kept, bound))
    if x is None:
        widened, least, _ = _relax(kept, {"null space": bound})
        x = None if least is None else solve(H, f, stacked(kept, widened))
        x = least if x is None else x
    return x


def _relax(hard: Rows, soft: Mapping[str, Rows]) -> tuple[Rows, Array | None, float]:
    """Return soft rows widened by the least violation that the hard rows leave.

    Also an x within them, and the worst violation; rows, None, inf if none is found.

    Joints pass their bounds before things come too near, and before contacts move; none
    of them more than is needed.
    """
    rows = stacked(*soft.values())
    n, s = hard.A.shape[1], len(rows.A)
    cost = np.concatenate(
        [np.full(len(some.A), _ORDER[kind]) for kind, some in soft.items()]
    )
    weights = np.concatenate([np.full(n, _INDIFFERENT), cost])
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
    widened = Rows(
        rows.A,
        np.minimum(rows.lower, reached - slack),
        np.maximum(rows.upper, reached + slack),
    )
    return widened, x[:n], float(np.abs(x[n:]).max(initial=0.0))
