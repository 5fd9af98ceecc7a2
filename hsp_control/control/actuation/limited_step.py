"""Steps within limits: the nearest to what the law wants, or the least violation."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.identity_cache import IdentityCache
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import copy
from hsp_control.common.native import Timed, are_native, bind, only_if, sequence
from hsp_control.common.step_plan import CallSequence
from hsp_control.constraints.limits.acceleration_bounds import Bounds
from hsp_control.control.actuation.deviation_cost import Directions
from hsp_control.control.actuation.dual_active_set import Problem, Workspace
from hsp_control.control.actuation.status import Status
from hsp_control.control.actuation.step_qp import (
    FORCES,
    LEAST_VIOLATION,
    NEAREST,
    NEAREST_AGAIN,
    UNSOLVED,
    Forces,
    Places,
    Programmes,
    Result,
    Wanted,
    solve_step,
)
from hsp_control.control.actuation.support import Support
from hsp_control.law import Resolution
from hsp_control.robot import RobotState

_RELAXATION_COST = {
    "contacts": 1e3,
    "distances": 30.0,
    "motion": 1.0,
    "holding": 0.1,
}
"""Cost of a violation, where limits contradict each other: the most expensive kind is
relaxed last."""
_REGULARISATION, _ROUNDS = 1e-6, 4
"""Cost of all other unknowns while the violation is minimised, and the number of
rounds. Each round penalises the difference from the result of the round before, so that
this cost fades. Otherwise 1e3 rad/s², which a far target requires, would outweigh a
violation."""

_STATUS = tuple(Status)  # by index: a call of `Status` takes 0.3 µs

Barriers = Mapping[str, tuple[Array, Array]]
"""Rows A a ≥ b by kind, ``distances`` or ``holding``: A, shape (k, nv), and b, (k,)."""


class LimitedStep:
    """The QP of one set of contacts and one stack of tasks, and what relaxes it."""

    def __init__(
        self,
        state: RobotState,
        resolution: Resolution,
        support: Support,
        bounds: Bounds,
        base: Indices,
        limited: Indices,
        weight: float,
        capacity: int,
    ) -> None:
        """Allocate."""
        n, p = state.robot.nv, support.size
        held = sum(contact.rows for contact in support.contacts)
        self.capacity = capacity  # how many rows of barriers there is room for
        counts = [len(base) + len(limited), len(support.cone), capacity]
        ends = np.cumsum([0, *counts, held])
        cones, barriers, contacts, k = map(int, ends[1:])
        self._barriers, self._used = barriers, 0
        self._motion = np.arange(k, k + n)
        self._contacts = np.arange(contacts, k)
        self._J = resolution.problem.task.jacobian[:held]
        width = n + p

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
        alike = np.full(width, _REGULARISATION**-0.5)
        self._soft, none = zeros(k + width), zeros(0)
        shared = lower, upper, none, len(base)
        self._rows = Problem(zeros((n, n)), zeros(p), A, begin, end, *shared)
        fixed = zeros((0, n))
        softened = lower, upper, self._soft, len(base)
        programmes = Programmes(
            forces=Problem(fixed, zeros(p), A, force_begin, force_end, *shared),
            nearest=self._rows,
            soft=Problem(zeros((0, 0)), alike, A, begin, end, *softened),
            x=zeros(width),
            force_memory=Workspace.of(width, k),
            memory=Workspace.of(width, k),
            soft_memory=Workspace.of(width, k, soft=True),
        )
        self._x = programmes.x
        # Effort, acceleration and forces of the last step
        self.result = Result(zeros(n), zeros(n), zeros(p))
        self._wanted = Wanted(state.mass_matrix, zeros(n), zeros(n))
        arguments = (
            self._wanted,
            Forces(
                support.map,
                support.forces,
                support.lower,
                support.upper,
                support.inverse_cost,
                weight,
            ),
            Directions.of(resolution, p > 0, state.robot.size or 1.0),
            bounds,
            Places(np.array([*base, *limited], dtype=np.int64), len(base)),
            programmes,
            self.result,
        )
        self._forces = bind(solve_step, FORCES, *arguments)
        self._nearest = bind(solve_step, NEAREST, *arguments)
        self._again = bind(solve_step, NEAREST_AGAIN, *arguments)
        self._least_violation = bind(solve_step, LEAST_VIOLATION, *arguments)
        self._write_mass_matrix = state.compute_mass_matrix
        self._calls = IdentityCache(self._after_input)

    def prepare(self, acceleration: Array, effort: Array) -> None:
        """Compile what `solve` calls, for these arrays."""
        self._calls.get(acceleration, effort)

    def nearest_if(
        self, acceleration: Array, effort: Array, found: Array
    ) -> Callable[[], float]:
        """Return a call that writes the nearest, as `solve`, if ``found[1]`` is not 0.

        It returns ``found[0]``, plus the `Status` if the QP was solved.
        """
        return only_if([*self._input(acceleration, effort), self._nearest], found)

    def _input(self, acceleration: Array, effort: Array) -> list[Callable[[], Any]]:
        """Return the calls that write what the QP reads.

        To bind the copies of two arrays takes a fiftieth of the time of binding all.
        """
        _, own, own_effort = self._wanted
        copies = bind(_copy_both, acceleration, own, effort, own_effort)
        return [self._write_mass_matrix, copies]

    def _after_input(
        self, acceleration: Array, effort: Array
    ) -> tuple[Callable[[], float], Callable[[], float]]:
        """Return the calls for forces and for the nearest, with all that they read."""
        first = self._input(acceleration, effort)
        return _one_call(*first, self._forces), _one_call(*first, self._nearest)

    def solve(
        self,
        acceleration: Array,
        effort: Array,
        redistribute: bool,
        barriers: Barriers,
    ) -> tuple[Status | None, float]:
        """Write the nearest to what the law wants to `result`."""
        by_forces, nearest = self._calls.get(acceleration, effort)
        where = {}
        if barriers or self._used:
            where = self._write_barriers(barriers, acceleration)
        code = by_forces() if redistribute else nearest()
        if code != UNSOLVED:
            return _STATUS[int(code)], 0.0
        return self._relax(where)

    def _write_barriers(
        self, barriers: Barriers, acceleration: Array
    ) -> dict[str, Indices]:
        """Write the rows of the barriers; return where they are, by kind."""
        A, end, lower = self._rows.A, self._rows.end, self._rows.lower
        n, r, where = len(acceleration), self._barriers, {}
        for kind, (rows, least) in barriers.items():
            place = np.arange(r, r + len(least))
            A[place, :n] = rows
            end[place] = n
            lower[place] = least - rows @ acceleration
            where[kind] = place
            r += len(least)
        unused = slice(r, self._barriers + self._used)
        end[unused], lower[unused] = 0, -np.inf
        self._used = r - self._barriers
        return where

    def _relax(self, barriers: dict[str, Indices]) -> tuple[Status | None, float]:
        """Relax the limits as little as possible, and solve again.

        Contacts are kept longest, then distances, then joint motion, see
        `_RELAXATION_COST`.
        """
        A, end = self._rows.A, self._rows.end
        lower, upper = self._rows.lower, self._rows.upper
        contacts = self._contacts
        A[contacts, : self._J.shape[1]] = self._J
        end[contacts] = self._J.shape[1]
        lower[contacts] = upper[contacts] = 0.0
        try:
            soft = {"contacts": contacts, "motion": self._motion, **barriers}
            relaxation = self._loosen(soft)
            if not np.isfinite(relaxation):
                return None, np.inf
            # If rounding leaves no room within the relaxed limits, the result is what
            # violates them least.
            self._again()
            return Status.RELAXED, relaxation
        finally:
            end[contacts] = 0
            lower[contacts], upper[contacts] = -np.inf, np.inf

    def _loosen(self, soft: Mapping[str, Indices]) -> float:
        """Widen soft rows as little as the others permit; return the largest violation.

        It is inf if the solver finds none.
        """
        A, lower, upper = self._rows.A, self._rows.lower, self._rows.upper
        self._soft[:] = 0.0
        for kind, rows in soft.items():
            self._soft[rows] = _RELAXATION_COST[kind] ** -0.5
        self._x[:] = 0.0
        found = np.full_like(self._x, np.nan)
        for _ in range(_ROUNDS):
            if self._least_violation() == UNSOLVED:
                break
            found[:] = self._x
        if not np.isfinite(found).all():
            return np.inf
        where = np.concatenate([*soft.values()])
        reached = np.concatenate([A @ found, found])[where]
        low, high = lower[where], upper[where]
        slack = 1e-7 * (1.0 + np.abs(reached))
        lower[where] = np.minimum(low, reached - slack)
        upper[where] = np.maximum(high, reached + slack)
        beyond = np.maximum(low - reached, reached - high)
        return float(np.maximum(beyond, 0.0).max(initial=0.0))


def _one_call(*calls: Callable[[], Any]) -> Callable[[], float]:
    """Return one call for several, with the result of the last one."""
    if are_native(calls):
        return sequence([*map(Timed, calls)], 0.0)
    return CallSequence(*calls)


@kernel
def _copy_both(a: Array, own_a: Array, b: Array, own_b: Array) -> None:
    """Copy two vectors, shape (nv,) each."""
    copy(a, own_a)
    copy(b, own_b)
