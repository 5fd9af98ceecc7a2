"""Whether an acceleration and its effort are within the limits, as calls."""

from typing import NamedTuple, Self

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.constraints.limits.barriers import BarrierRows
from hsp_control.control.actuation.limited_step import Barriers, QPOutcome
from hsp_control.control.actuation.limits_in_force import LimitSet
from hsp_control.engine.plans import AnyCall, PartCall, PartCalls
from hsp_control.robot import RobotState


class LimitsOutcome(NamedTuple):
    """Results of a check of the limits: the engine writes 0 or 1, shapes (1,)."""

    motion: Indices
    """Whether a bound on the accelerations is violated."""
    effort: Indices
    """Whether a bound on the efforts is violated."""
    rows: Indices
    """Whether a row of a barrier or of static efforts is violated."""
    violated: Indices
    """Whether any of these is violated."""
    beyond: Indices
    """Whether a joint is beyond its range, or faster than its limit; see `Status`."""

    @classmethod
    def allocate(cls) -> Self:
        """Return the outcome without violations."""
        return cls(*np.zeros((5, 1), dtype=np.int64))


class LimitChecks:
    """Compares an acceleration, and M a + N, with a set of limits.

    Attributes:
        outcome: The calls' results.
        rows: Room for the rows A a ≥ b that the engine writes, by kind: of
        ``barriers``, or of ``holding`` against static efforts.
        compiled: Whether it writes all of them; else Python does.
    """

    def __init__(
        self, state: RobotState, limits: LimitSet, acceleration: Array, qp: QPOutcome
    ) -> None:
        """Allocate.

        Args:
            state: The robot's state, which has the effort M a + N.
            limits: The limits.
            acceleration: The acceleration a, shape (nv,).
            qp: The outcome of the QP, unsolved wherever it was not tried.
        """
        self._state, self._limits, self._a, self._qp = state, limits, acceleration, qp
        self.outcome = LimitsOutcome.allocate()
        self.rows = self._room()
        own = limits.limits is not None and bool(limits.limits.barriers)
        self.compiled = not own or "barriers" in self.rows

    @property
    def count(self) -> int:
        """The capacity in rows."""
        return sum(len(each.least) for each in self.rows.values())

    def calls(self, excluded: Indices) -> PartCalls:
        """Return the calls that compare; ``excluded``: dofs of static efforts."""
        if self._limits.limits is None:
            return []
        return [self._check(), *self._row_checks(excluded)]

    def _check(self) -> PartCall:
        """Return the call that compares a and M a + N with their bounds."""
        state, limits = self._state, self._limits
        return PartCall(
            engine.CheckLimits,
            time=state.time,
            q=state.q,
            v=state.v,
            a=self._a,
            tau=state.effort,
            where=state.robot.dof_indices,
            limits=limits.motion,
            ends=limits.ends,
            held=limits.sent.held,
            bounds=limits.bounds,
            outcome=self.outcome,
            unsolved=self._qp.unsolved,
        )

    def _room(self) -> dict[str, BarrierRows]:
        """Return room for the rows that the engine writes, by kind."""
        limits, state = self._limits.limits, self._state
        if limits is None:
            return {}
        found, nv = {}, state.robot.nv
        rooms = [each.room(state) for each in limits.barriers]
        if rooms and all(rooms):  # otherwise Python computes some of them
            found["barriers"] = BarrierRows.allocate(sum(rooms), nv)
        if limits.static_effort is not None:
            found["holding"] = BarrierRows.allocate(limits.static_effort.room(), nv)
        return found

    def _row_checks(self, excluded: Indices) -> PartCalls:
        """Return the calls that write these rows, and compare a with them."""
        limits, state, a = self._limits.limits, self._state, self._a
        calls: list[AnyCall] = []
        if limits is None or not self.rows:
            return calls
        for kind, rows in self.rows.items():
            calls.append(PartCall(engine.Clear, number=rows.number))
            if kind == "barriers":
                for each in limits.barriers:
                    calls += each.row_calls(state, limits.bandwidth, a, rows)
            elif limits.static_effort is not None:
                given = state, limits.bandwidth, excluded, rows
                calls += limits.static_effort.row_calls(*given)
            calls.append(
                PartCall(engine.CheckRows, rows=rows, a=a, outcome=self.outcome)
            )
        return calls

    def barriers(self) -> Barriers:
        """Return the rows A a ≥ lower for barriers and static efforts, by kind."""
        limits, state = self._limits.limits, self._state
        found: dict[str, tuple[Array, Array]] = {}
        if limits is None:
            return found
        found |= {kind: rows.used for kind, rows in self.rows.items()}
        if limits.barriers and "barriers" not in self.rows:
            parts = [
                each.rows(state, limits.bandwidth, self._a) for each in limits.barriers
            ]
            A, lower = (np.concatenate(each) for each in zip(*parts, strict=True))
            found["barriers"] = A, lower
        return found
