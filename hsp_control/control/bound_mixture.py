"""A step of several sets of tasks or of limits that are mixed, as one call."""

from collections.abc import Callable, Mapping, Sequence
from itertools import chain
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation, Delivered
from hsp_control.control.actuation.delivered import Kept
from hsp_control.control.actuation.limited_step import EXACT, LIMITED, STATUSES
from hsp_control.control.actuation.limits_in_force import LimitsInForce
from hsp_control.control.actuation.support import Support
from hsp_control.control.planned import PlannedContact, PlannedTask
from hsp_control.engine import OnlyIf, Plan
from hsp_control.engine.plans import TIME, AnyCall, PartCall, PartCalls, Step, planned
from hsp_control.robot import RobotState

Shares = Sequence[tuple[float, ActiveStack]]
"""The share of each set of contacts and tasks that is active, and its stack."""


class Choice(NamedTuple):
    """Which sets of contacts and tasks a step resolves; see `Mixture`."""

    # the fading tasks and contacts, and those that a stack has
    fading: Sequence[PlannedTask | PlannedContact]
    members: Mapping[ActiveStack, Sequence[bool]]
    at: Callable[[float], Shares]  # the same, chosen in Python

    @property
    def native(self) -> bool:
        """Whether the engine can choose: no part follows a schedule."""
        few = len(self.fading) <= MOST_CHOSEN
        return few and all(each.unscheduled for each in self.fading)


MOST_CHOSEN = 64
"""Parts that may fade at once where the engine chooses (``ChooseSets``)."""


class BoundMixture:
    """The law of each set of tasks within each set of limits, and the weighted mean.

    All is one call, wherever parts deliver M a + N or the result of one QP, also with
    contacts: it evaluates the changes, chooses the sets that have a share, makes their
    parts, and mixes them. Elsewhere `Mixture` makes the step, part by part.
    """

    free = None  # the engine's loop makes no such steps

    def __init__(
        self,
        state: RobotState,
        choice: Choice,
        actuation: Callable[[ActiveStack, int], Actuation],
        limits: LimitsInForce,
        origin: Array,
        evolving: Sequence[Step],
    ) -> None:
        """Bind the calls.

        Args:
            state: The state that it moves.
            choice: The sets of contacts and tasks.
            actuation: Returns the actuation of a stack's law within a set of limits,
                by its index.
            limits: The sets of limits.
            origin: Reading of its calls' clock at time 0, shape (1,) [s].
            evolving: The calls that write changing values, at a time.
        """
        self.state, self._choice = state, choice
        self._stacks = sorted(choice.members, key=by_age)
        self._places = {each: k for k, each in enumerate(self._stacks)}
        count, many = len(self._stacks), len(limits.all)
        self._shares, self._on = np.zeros(count), np.zeros(count, dtype=np.int64)
        self._whole = whole = _Placed([each.support for each in self._stacks])
        nv = state.robot.nv
        parts = np.zeros((count * many, 2 * nv + whole.size))
        mean = np.zeros(parts.shape[1])
        which, statuses = np.zeros((2, count * many), dtype=np.int64)
        self._worst = np.zeros(1, dtype=np.int64)
        within = np.ones(many, dtype=np.int64)  # the sets of limits in force
        begin: list[PartCall] = []
        if many > 1:
            begin.append(PartCall(engine.HasShare, shares=limits.shares, on=within))
        steps = [*evolving, *planned([*begin, *self._choosing()]).steps()]
        self.rehearsed: list[Plan] = []  # all parts, whether or not they have a share
        self._actuations: list[list[Actuation]] = []
        for s, stack in enumerate(self._stacks):
            made = [*stack.calls]
            self._actuations.append([])
            for k in range(many):
                one, own = slice(s * many + k, s * many + k + 1), actuation(stack, k)
                self._actuations[s].append(own)
                part, forces = parts[one.start], np.zeros(stack.support.size)
                at = part[:nv], part[nv : 2 * nv], forces
                kept = own.keeping(*at, Kept(which[one], statuses[one]))
                places = whole.placing(stack.support, forces, part[2 * nv :])
                calls = [*own.calls, *planned([kept, *places]).steps()]
                if many > 1:
                    plan = Plan(calls)
                    calls = [OnlyIf(calls=plan, condition=within[k : k + 1])]
                    self.rehearsed.append(plan)
                made += calls
            self.rehearsed.append(Plan(made))
            condition = self._on[s : s + 1]
            steps.append(OnlyIf(calls=self.rehearsed[-1], condition=condition))
        mix = PartCall(
            engine.MixParts,
            shares=self._shares,
            limits=limits.shares,
            parts=parts,
            kept=which,
            statuses=statuses,
            limited=int(LIMITED),
            mean=mean,
            worst=self._worst,
        )
        steps += planned([mix]).steps()
        self.move = state.bind_move(steps, origin)
        self._move = self.move.__call__
        self.resolved = list[ActiveStack]()
        self.damped = ""
        self._limits = limits
        self._mean = Delivered(mean[nv : 2 * nv], mean[:nv], mean[2 * nv :], EXACT, 0.0)

    def _choosing(self) -> PartCalls:
        """Return the calls that choose the sets, and write their shares."""
        choice = self._choice
        if not choice.native:
            return [PartCall(self._choose, t=TIME)]
        members = [choice.members[each] for each in self._stacks]
        shape = len(self._stacks), len(choice.fading)
        lows, highs = np.zeros((2, len(choice.fading)))
        chosen = PartCall(
            engine.ChooseSets,
            lows=lows,
            highs=highs,
            members=np.array(members, dtype=np.int64).reshape(shape),
            on=self._on,
            shares=self._shares,
        )
        calls = list[AnyCall]()
        for k, each in enumerate(choice.fading):
            one = slice(k, k + 1)
            calls += each.interval_calls(lows[one], highs[one])
        return [*calls, chosen]

    def _choose(self, t: float) -> None:
        self._on[:], self._shares[:] = 0, 0.0
        for share, stack in self._choice.at(t):
            place = self._places.get(stack)
            if place is None:  # the step is made in Python
                self._on[:], self._shares[:] = 0, 0.0
                return
            self._on[place], self._shares[place] = 1, share

    def make(self, t: float, q: ArrayLike, v: ArrayLike) -> Delivered | None:
        """Move to a state; return the delivered effort; None: the step needs Python."""
        mixed = self._move(t, q, v)
        if mixed is None:  # refused: lists, for example, or invalid values
            mixed = self.state.advance(self.move, t, q, v)
        if not mixed:
            return None
        resolved: list[ActiveStack] = []
        self.damped = ""
        for share, stack in zip(self._shares.tolist(), self._stacks, strict=True):
            if share:
                resolved.append(stack)
                stack.share = share
                self.damped = self.damped or stack.damped
        self.resolved = resolved
        mean, status, forces = self._mean, self._worst.item(), self._mean.forces
        if forces.size:
            forces = forces[self._whole.columns(resolved[-1].support)]
        relaxation = self._relaxation if status else mean.relaxation
        # Not `_replace`: its tuples would wake the garbage collector.
        return Delivered(
            mean.effort, mean.acceleration, forces, STATUSES[status], relaxation
        )

    @property
    def _relaxation(self) -> float:
        """The largest violation of a relaxed limit [rad/s² or m/s²]."""
        shares = self._limits.shares.tolist()
        return max(
            own.relaxation
            for on, made in zip(self._on.tolist(), self._actuations, strict=True)
            for share, own in zip(shares, made, strict=True)
            if on and share
        )

    def rehearse(self, t: float) -> None:
        """Run the calls of all parts, active or not."""
        for each in self.rehearsed:
            each(t)


class _Placed:
    """The forces of the contacts of several stacks, one after another."""

    def __init__(self, supports: Sequence[Support]) -> None:
        """Assign indices to contacts."""
        self._places: dict[int, slice] = {}  # by the contact's identity
        self._columns: dict[Support, Indices] = {}
        self.size = 0
        for each in supports:
            for contact, points in zip(each.contacts, each.points, strict=True):
                if id(contact) not in self._places:
                    end = self.size + 3 * (points.stop - points.start)
                    self._places[id(contact)] = slice(self.size, end)
                    self.size = end
        for each in supports:
            places = [self._places[id(contact)] for contact in each.contacts]
            columns = [np.arange(place.start, place.stop) for place in places]
            self._columns[each] = np.array([*chain(*columns)], dtype=np.int64)

    def columns(self, own: Support) -> Indices:
        """Return the indices of some contacts' forces among those of all."""
        return self._columns[own]

    def placing(self, own: Support, forces: Array, out: Array) -> list[PartCall]:
        """Return the calls that copy forces of some contacts to those of all."""
        calls = []
        for contact, points in zip(own.contacts, own.points, strict=True):
            here = slice(3 * points.start, 3 * points.stop)
            place = self._places[id(contact)]
            calls.append(PartCall(engine.Copy, x=forces[here], out=out[place]))
        return calls


def by_age(stack: ActiveStack) -> tuple[int, list[int]]:
    """Return a key that sorts sets: the last one has the most, and the newest, parts.

    A set comes after all of its subsets.
    """
    keys = sorted((each.planned.key for each in stack.stacked), reverse=True)
    return len(stack.contacts), keys
