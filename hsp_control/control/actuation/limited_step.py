"""Steps within limits: the nearest to the law's command, or the least violation.

The unknowns of the QP are x = (δ, g): δ the deviation from the law's acceleration, and
g the contact forces in robot weights. The rows, in this order:

    base        (M a + N - F f)_base = 0                          no motor acts there
    effort      bounds on M a + N - F f, within the rate limit of the last effort
    cones       friction cones of f
    barriers    ∇h·a and ∇G·a from `Barrier` and `StaticEffort`
    contacts    J_c δ = 0, only where limits contradict each other: else it holds
                because no direction of the contacts is among those that may move

and the bounds of x: those on a from position, velocity and acceleration limits, and
those of f.
"""

from collections.abc import Mapping
from enum import IntEnum
from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.limits.acceleration_bounds import Bounds
from hsp_control.constraints.limits.barriers import BarrierRows
from hsp_control.control.actuation.deviation_cost import (
    Directions,
    Levels,
    write_directions,
    write_inverse_root,
)
from hsp_control.control.actuation.dual_active_set import QP, Workspace
from hsp_control.control.actuation.support import Support
from hsp_control.edge import BoundLaw
from hsp_control.edge.excess import Permitted, StepLimits, Wanted
from hsp_control.edge.held_levels import held_levels
from hsp_control.edge.limit_share import limit_share
from hsp_control.edge.limited_target import Parts, limited_target
from hsp_control.engine.plans import AnyCall, OnlyIf, PartCall, PartCalls
from hsp_control.robot import RobotState


class Status(IntEnum):
    """How much of the law's acceleration is delivered within the limits."""

    EXACT = 0
    """All of it, with contact forces of minimum norm."""
    REDISTRIBUTED = 1
    """All of it, with contact forces chosen by a QP."""
    LIMITED = 2
    """The nearest acceleration within the limits, which the model keeps."""
    RELAXED = 3
    """The limits contradict each other: they are relaxed as little as possible."""
    BEYOND = 4
    """A joint is more than 1 mrad or mm beyond its range, or faster than its limit by
    more than 2 %, whatever is delivered: the robot differs from its model. Each
    excess is in the log, ``position_excess`` and ``velocity_excess``."""


EXACT, LIMITED, RELAXED = Status.EXACT, Status.LIMITED, Status.RELAXED
BEYOND = Status.BEYOND
"""For the step: up to Python 3.11 `Status.EXACT` takes 80 ns."""


def _force_cost(unactuated: int) -> float:
    """Return the cost of squared forces, in robot weights, relative to accelerations.

    It makes the forces unique. With a fixed base commanded ones, too, cost a hundredth
    of the null space's least, so that the effort is continuous where forces alone cease
    to keep the limits. With a floating base rounding does not permit that: there
    commanded ones cost more than the null space.
    """
    return 1e-6 if unactuated else 1e-14


class QPOutcome(NamedTuple):
    """The outcome of a QP, written by the engine, shapes (1,)."""

    unsolved: Indices
    """1 where there is no result: none was requested, the constraints contradict each
    other, or the solver gave up; else 0."""
    status: Indices
    """The `Status` of the result."""

    @classmethod
    def allocate(cls) -> Self:
        """Return the outcome of a QP before its solution."""
        return cls(np.ones(1, dtype=np.int64), np.zeros(1, dtype=np.int64))


class Forces(NamedTuple):
    """The permitted contact forces f, see `Support`; size 0: none."""

    map: Array  # F, shape (nv, p)
    first: Array  # forces nearest to the commanded ones, shape (p,) [N]
    lower: Array  # lower bounds, shape (p,) [N]
    upper: Array  # upper bounds, shape (p,) [N]
    inverse_cost: Array  # e, shape (p,): the cost is Σ (f - f_ref)²/e
    weight: float  # robot's weight [N]


class Places(NamedTuple):
    """The indices of the rows."""

    # degrees of freedom of the first rows: those without a motor, then those with a
    # limit on their effort
    dofs: Indices
    base: int  # how many have no motor


class Result(NamedTuple):
    """The solution: effort and acceleration, shape (nv,), forces, shape (p,)."""

    effort: Array
    acceleration: Array
    forces: Array


_RELAXATION_COST = {"contacts": 1e3, "barriers": 30.0, "motion": 1.0, "holding": 0.1}
"""Cost of a violation, where limits contradict each other: the most expensive kind is
relaxed last."""
_SOFTNESS = {kind: cost**-0.5 for kind, cost in _RELAXATION_COST.items()}
_REGULARISATION = 1e-6
"""Cost of all other unknowns while the violation is minimised; it fades, see
``engine/qp/relaxed_step.hpp``."""

STATUSES = tuple(Status)  # by index: a call of `Status` takes 0.3 µs

Barriers = Mapping[str, tuple[Array, Array]]
"""Rows A a ≥ b by kind, ``barriers`` or ``holding``: A, shape (k, nv), and b, (k,)."""


def _at_the_edge(
    state: RobotState, law: BoundLaw, wanted: Wanted, limits: StepLimits
) -> tuple[PartCalls, Array, Array]:
    """Return the calls that write the desired step, costs of levels and the slack."""
    taken, (self_motions, brakings) = law.self_motions(state.v)
    parted, levels = law.by_levels(state.v)
    rest = levels.at_rest[-1]
    shared, shares = limit_share(wanted, law, self_motions[0], rest, limits)
    holding, held = held_levels(wanted, state.v, law, levels, shares.slack, limits)
    parts = Parts(law.acceleration, law.edge.damped, *self_motions, *brakings)
    target = limited_target(wanted, parts, limits, shares.by_limits)
    return [taken, parted, shared, holding, target], held, shares.slack


class LimitedStep:
    """The QP of one set of contacts and one stack of tasks, and its relaxation."""

    def __init__(
        self,
        state: RobotState,
        law: BoundLaw,
        support: Support,
        bounds: Bounds,
        wanted: Wanted,
        limited: Indices,
        outcome: QPOutcome,
        capacity: int,
        permitted: Permitted | None,
    ) -> None:
        n, p, base = state.robot.nv, support.size, support.base
        held = sum(contact.rows for contact in support.contacts)
        self.capacity = capacity  # capacity for rows of barriers
        counts = [len(base) + len(limited), len(support.cone), capacity]
        ends = np.cumsum([0, *counts, held])
        cones, barriers, contacts, k = map(int, ends[1:])
        self._barriers, self._used = barriers, 0
        width = n + p

        # The rows, and the bounds of x
        A, zeros = np.zeros((k, width)), np.zeros
        begin, end = np.zeros((2, k), dtype=np.int64)
        lower, upper = np.full((2, k + width), -np.inf)
        upper[:] = np.inf
        supporting = np.isin([*base, *limited], [*base, *support.supporting_dofs])
        end[:cones] = np.where(supporting, width, n)
        force_begin, force_end = zeros((2, k), dtype=np.int64)
        force_begin[:cones][supporting], force_end[:cones][supporting] = n, width
        A[cones:barriers, n:] = support.cone
        lower[cones:barriers] = 0.0
        for r in range(cones, barriers):
            point = (r - cones) // 4
            begin[r] = force_begin[r] = n + 3 * point
            end[r] = force_end[r] = n + 3 * point + 3
        # The QPs on them: of deviation and forces, at the law's cost; of the forces
        # alone; of both, all at the same cost, with soft rows
        alike = np.full(width, _REGULARISATION**-0.5)
        hard = lower, upper, zeros(0), len(base)
        self._rows = QP(zeros((n, n)), zeros(p), A, begin, end, *hard)
        redistributed = QP(zeros((0, n)), zeros(p), A, force_begin, force_end, *hard)
        self._softness = zeros(k + width)
        self._softness[barriers:contacts] = _SOFTNESS["holding"]
        self._softness[contacts:k] = _SOFTNESS["contacts"]
        self._softness[k : k + n] = _SOFTNESS["motion"]
        relaxed = self._rows._replace(
            end=end.copy(), lower=lower.copy(), upper=upper.copy()
        )
        soft = relaxed._replace(JT=zeros((0, 0)), own=alike, softness=self._softness)
        memories = [Workspace.of(width, k) for _ in range(3)]
        soft_memory = Workspace.of(width, k, soft=True)

        # Inputs and outputs; the result is that of the last step
        self.result = Result(zeros(n), zeros(n), zeros(p))
        self.relaxation = zeros(1)  # the largest violation, if it is relaxed
        self._wanted = wanted
        first, edges = support.forces, (support.lower, support.upper)
        cost = support.inverse_cost, support.weight
        forces = Forces(support.map, first, *edges, *cost)
        places = Places(np.array([*base, *limited], dtype=np.int64), len(base))
        directions = Directions.of(n)
        x, moving, none = zeros(width), np.zeros(1, np.int64), np.zeros(1, np.int64)
        self._outcome = outcome
        around = {
            "wanted": wanted,
            "forces": forces,
            "bounds": bounds,
            "places": places,
        }

        # The calls that solve them
        def written(became: QPOutcome) -> PartCall:
            return PartCall(
                engine.LimitedResult,
                **around,
                x=x,
                result=self.result,
                unsolved=became.unsolved,
            )

        def optimum(
            qp: QP,
            count: Indices,
            work: Workspace,
            reached: Status,
            became: QPOutcome,
            warm: bool = True,
        ) -> PartCalls:
            solved = PartCall(
                engine.SolveLimitedStep,
                reached=int(reached),
                warm=warm,
                problem=qp,
                moving=count,
                x=x,
                work=work,
                outcome=became,
            )
            return [solved, written(became)]

        def begin_with(cost: float, own: Array) -> PartCall:
            return PartCall(
                engine.BeginLimitedStep, forces=forces, cost=cost, own=own, x=x
            )

        def root(*, standing: bool) -> PartCall:
            return write_inverse_root(
                levels, directions, standing, self._rows.JT, moving
            )

        rows: list[AnyCall] = [*state.inertia.calls, law.damped_beside(state.v)]
        # Minimum costs of deviations; with a floating base priorities are strict.
        self.held, self.slack = zeros(len(law.ends)), np.ones(1)
        if permitted is not None:
            kept = slice(barriers, contacts)
            limits = StepLimits(*bounds[:2], A[kept], lower[kept], permitted)
            target, self.held, self.slack = _at_the_edge(state, law, wanted, limits)
            rows += target
        costs = self.held, self.slack
        levels = Levels.of(law, p > 0, state.robot.size or 1.0, *costs)
        rows.append(
            PartCall(engine.LimitedRows, **around, A=A, lower=lower, upper=upper)
        )
        write = write_directions(levels, directions)
        start = begin_with(_force_cost(len(base)), self._rows.own)
        within = optimum(self._rows, moving, memories[0], LIMITED, outcome)
        closest = [write, root(standing=p > 0), start, *within]
        # Without a feasible step: soft rows, also those of contacts.
        copied = PartCall(
            engine.RelaxedRows,
            lower=lower,
            upper=upper,
            end=end,
            J=law.problem.task.jacobian[:held],
            first=contacts,
            A=A,
            relaxed_lower=relaxed.lower,
            relaxed_upper=relaxed.upper,
            relaxed_end=relaxed.end,
        )
        least = PartCall(
            engine.LeastViolation,
            reached=int(RELAXED),
            problem=soft,
            x=x,
            work=soft_memory,
            outcome=outcome,
        )
        widened = PartCall(
            engine.Widen,
            unsolved=outcome.unsolved,
            A=A,
            x=x,
            softness=self._softness,
            lower=relaxed.lower,
            upper=relaxed.upper,
            relaxation=self.relaxation,
        )
        # If by rounding the relaxed limits are infeasible, the result has the smallest
        # violation, so the status of the last QP is not used. Different active sets are
        # then equally good up to rounding: the QP starts with none, so that the result
        # does not depend on earlier steps.
        last = optimum(
            relaxed, moving, memories[2], RELAXED, QPOutcome.allocate(), warm=False
        )
        again = [root(standing=False), start, *last]
        loosened = OnlyIf(
            [copied, least, written(outcome), widened, *again], outcome.unsolved
        )
        self._nearest = [*rows, *closest, loosened]
        self._redistributed: PartCalls = self._nearest
        self._find_nearest = self._find_forces = state.plan(self._nearest).call()
        if p > 0:
            begun = begin_with(1.0, redistributed.own)
            forces_alone = redistributed, none, memories[1]
            at_once = optimum(*forces_alone, Status.REDISTRIBUTED, outcome)
            otherwise = OnlyIf([*closest, loosened], outcome.unsolved)
            self._redistributed = [*rows, begun, *at_once, otherwise]
            self._find_forces = state.plan(self._redistributed).call()

    def nearest_if(
        self, condition: Indices, before: PartCalls, rows: Mapping[str, BarrierRows]
    ) -> OnlyIf:
        """Return a call that writes the nearest, as `solve`, if a condition is not 0.

        Args:
            condition: Shape (1,).
            before: Calls that are made first.
            rows: All rows of barriers, by kind.
        """
        return OnlyIf([*before, *self._placing(rows), *self._nearest], condition)

    def solved_if(
        self, redistribute: Indices, nearest: Indices, rows: Mapping[str, BarrierRows]
    ) -> PartCalls:
        """Return the calls equivalent to `solve`, where one of these is not 0.

        Args:
            redistribute: Whether other forces may do, shape (1,).
            nearest: Whether the acceleration has to change, shape (1,).
            rows: All rows of barriers, by kind.
        """
        placed = self._placing(rows)
        return [
            OnlyIf([*placed, *self._redistributed], redistribute),
            OnlyIf([*placed, *self._nearest], nearest),
        ]

    def _placing(self, rows: Mapping[str, BarrierRows]) -> list[PartCall]:
        """Return the calls that write all rows of barriers into the QP."""
        placed, r = list[PartCall](), self._barriers
        for kind, each in rows.items():
            own = slice(r, r + len(each.least))
            placed.append(self._placed(each, own))
            self._softness[own] = _SOFTNESS[kind]
            r = own.stop
        return placed

    def _placed(self, rows: BarrierRows, own: slice) -> PartCall:
        """Return the call that writes rows of barriers into the QP."""
        return PartCall(
            engine.PlaceRows,
            rows=rows,
            a=self._wanted.acceleration,
            A=self._rows.A[own],
            end=self._rows.end[own],
            lower=self._rows.lower[own],
        )

    def solve(
        self, redistribute: bool, barriers: Barriers
    ) -> tuple[Status | None, float]:
        """Write the nearest to the law's command to `result`."""
        if barriers or self._used:
            self._write_barriers(barriers, self._wanted.acceleration)
        (self._find_forces if redistribute else self._find_nearest)()
        return (None, np.inf) if self._outcome.unsolved.item() else self.found()

    def found(self) -> tuple[Status, float]:
        """Return the solution, and the largest violation of a relaxed limit."""
        status = STATUSES[self._outcome.status.item()]
        return status, self.relaxation.item() if status is RELAXED else 0.0

    def _write_barriers(self, barriers: Barriers, acceleration: Array) -> None:
        """Write the rows of the barriers."""
        A, end, lower = self._rows.A, self._rows.end, self._rows.lower
        r = self._barriers
        for kind, (rows, least) in barriers.items():
            place, number = slice(r, r + len(least)), np.array([len(least)])
            given = BarrierRows(number, np.ascontiguousarray(rows), least)
            at = {"A": A[place], "end": end[place], "lower": lower[place]}
            # With the same call as in a step of a single call: equal bit for bit.
            engine.PlaceRows(rows=given, a=acceleration, **at)()
            self._softness[place] = _SOFTNESS[kind]
            r += len(least)
        unused = slice(r, self._barriers + self._used)
        end[unused], lower[unused] = 0, -np.inf
        self._used = r - self._barriers
