"""Steps while tasks and limits fade in and out: weighted means of the results."""

from collections.abc import (
    Callable,
    Collection,
    Iterable,
    Sequence,
    Set,
)
from copy import copy
from itertools import pairwise

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ControllerError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation, Delivered, Status
from hsp_control.control.actuation.limits_in_force import LimitSet, LimitsInForce
from hsp_control.control.actuation.support import Support
from hsp_control.control.bound_mixture import BoundMixture, Choice, by_age
from hsp_control.control.bound_step import BoundStep
from hsp_control.control.fitting import priority_of
from hsp_control.control.gains_in_force import GainsInForce
from hsp_control.control.planned import PlannedContact, PlannedTask
from hsp_control.control.setup import Setup
from hsp_control.engine.plans import Step
from hsp_control.law.outcome import DAMPED, NOT_FINITE
from hsp_control.robot import Robot, RobotState

AccelerationModifier = Callable[
    [RobotState, ActiveStack, Array], tuple[Array, Array | None]
]
"""How compensators act between the law and the limits: a function of (state, active
stack, a). It returns the acceleration to deliver, shape (nv,), and an additional effort
besides M a + N, shape (nv,), or None. While tasks fade it is called for every set of
them, weighted by the stack's `share`. State and stack are read-only; a is a copy."""


def _checked(found: object, robot: Robot) -> tuple[Array, Array | None]:
    """Return a modifier's result, checked as in `AccelerationModifier`."""
    if not isinstance(found, tuple) or len(found) != 2:
        raise ControllerError(
            f"modifier returned {type(found).__name__}; needs (acceleration, effort or "
            "None)"
        )
    a, offset = found
    own = robot.check_tangent(a, "the modifier's acceleration")
    if offset is None:
        return own, None
    return own, robot.check_tangent(offset, "the modifier's effort")


_Active = tuple[frozenset[int], frozenset[tuple[int, int]]]
"""The contacts and the tasks that are active, by identity: to compare their values
would cost more than the step."""


class Mixture:
    """Resolves the law for the contacts and tasks that are active at a time.

    A step is the mean over u in (0, 1) of d(u), the result of the law within the limits
    for the parts that are active at u: a task where departure < u < presence; a contact
    that is almost lifted where u < its share (`PlannedContact.share`), and beyond that
    the task that takes its place (`PlannedTask.weight_beyond`). So with w1 ≥ w2 ≥ ...
    the presences of tasks that come, a step is

        (1 - w1) d{} + (w1 - w2) d{1} + (w2 - w3) d{1, 2} + ...

    and with a task that comes, w, while another one goes, (1 - w) d{old} + w d{new}.
    It is continuous, whatever binds. It keeps the limits, because they are convex in
    the acceleration, the effort and the forces, which are affine in one another. What
    is controlled by the same rows in all sets keeps its exact error equation, since
    these are linear in the acceleration, where no limit binds.
    """

    # the stacks that were resolved last, the active one at the end; empty before
    resolved: list[ActiveStack]
    steady: bool  # whether tasks, contacts and limits are the same at all times
    # tasks of each level, the highest priority first
    levels: tuple[tuple[PlannedTask, ...], ...]

    def __init__(
        self,
        state: RobotState,
        base: Sequence[int],
        limits: LimitsInForce,
        gains: GainsInForce,
        setup: Setup,
        threshold: float,
    ) -> None:
        self._state, self._base, self._limits = state, base, limits
        self._gains, self._threshold = gains, threshold
        self._stacks: dict[_Active, ActiveStack] = {}
        self._actuations: dict[tuple[ActiveStack, LimitSet], Actuation] = {}
        self.field, self.resolved = setup.field, []
        self._follow(setup)

    def following(self, setup: Setup) -> "Mixture":
        """Return the mixture of another setup; unchanged parts are bound already."""
        other = copy(self)
        field = setup.field
        if field != self.field:
            other._stacks, other.field = {}, field
        other._follow(setup)
        return other

    def _follow(self, setup: Setup) -> None:
        self._setup = setup
        contacts = {id(each) for each in setup.contacts}
        tasks = {(each.key, id(each.task)) for each in setup.tasks}
        sets = {id(limits) for limits, _ in setup.limits.sets}
        self._stacks = {
            key: stack
            for key, stack in self._stacks.items()
            if key[0] <= contacts and key[1] <= tasks
        }
        alive = {*self._stacks.values()}
        self._actuations = {
            (stack, limits): each
            for (stack, limits), each in self._actuations.items()
            if stack in alive and id(limits.limits) in sets
        }
        self._active: dict[tuple[tuple[int, ...], Set[int]], ActiveStack] = {}
        # the stacks that were bound ahead, and the fading parts that they have
        self._prepared: dict[ActiveStack, list[bool]] = {}
        self._fading = [each for each in setup.tasks if not each.always]
        self._moving = [each for each in setup.contacts if not each.always]
        self.levels = _levels(setup.tasks, self._state.robot)
        self._same_sets = setup.steady
        self.steady = setup.steady and setup.limits.end == -np.inf
        self._only: list[
            tuple[float, ActiveStack]
        ] = []  # if it is the same at all times
        # tasks of the first level with a bounded inverse in the last `resolve`, by
        # name; empty: none
        self.damped = ""

    def step(self, t: float, modifier: AccelerationModifier | None) -> Delivered:
        """Resolve the law at the state and its time [s], and return the result.

        Part by part: for a modifier, and where no `BoundMixture` is possible.
        """
        self._resolve(t, self._sets(t))
        return self._deliver(modifier)

    def resolve(self, t: float) -> None:
        """Resolve the law for each set of tasks that is active."""
        self._resolve(t, self._sets(t))

    def _resolve(self, t: float, sets: Iterable[tuple[float, ActiveStack]]) -> None:
        parts: list[ActiveStack] = []
        self.damped = ""
        for share, active in sets:
            active.share = share
            parts.append(active)
            outcome = active.resolve(t)
            if outcome is NOT_FINITE:
                active.raise_not_finite()
            if outcome is DAMPED and not self.damped:
                self.damped = active.damped
        self.resolved = parts

    def _sets(self, t: float) -> list[tuple[float, ActiveStack]]:
        """Return the share of each set that is active at a time, and its stack."""
        if self._only:
            return self._only
        tasks = [(each.weight(t), each) for each in self._fading]
        contacts = [(each.share(t), each) for each in self._moving]
        edges = {
            id(each): each.edge(t)
            for share, each in contacts
            if share < 1.0 and each.active(t)  # also at the time when it begins
        }
        partly = [
            *((id(each), *each.interval(t)) for w, each in tasks if 0.0 < w < 1.0),
            *((id(each), 0.0, share) for share, each in contacts if 0.0 < share < 1.0),
        ]
        ends = {u for _, *interval in partly for u in interval}
        sets: dict[ActiveStack, float] = {}
        for high, low in pairwise(sorted({0.0, 1.0, *ends}, reverse=True)):
            if high - low < _ROUNDING:
                continue
            on = {key for key, begin, end in partly if begin <= low and high <= end}
            lift = {id(c) for w, c in contacts if w < 1.0 and id(c) not in on}
            standing = [c for c in self._setup.contacts if id(c) not in lift]
            lifted = [edge for key, edge in edges.items() if key not in on]
            off = [
                task.key
                for w, task in tasks
                if (task.weight_beyond(t, lifted) if lifted else w) < 1.0
                and id(task) not in on
            ]
            stack = self._stack(standing, off)
            sets[stack] = sets.get(stack, 0.0) + (high - low)
        ordered = [(sets[each], each) for each in sorted(sets, key=by_age)]
        if self._same_sets:
            self._only = ordered
        return ordered

    def _deliver(self, modifier: AccelerationModifier | None) -> Delivered:
        """Return the result for the law that was resolved last."""
        # During a transition between sets of limits: the mixture of the steps within
        # both.
        sets = self._limits.sets
        single = len(self.resolved) == len(sets) == 1
        shares: list[float] = []
        parts: list[Array] = []
        worst, relaxation = Status.EXACT, 0.0
        whole = self.resolved[-1].support
        for active in self.resolved:
            a, offset = active.acceleration, None
            if modifier is not None:
                # It may change its acceleration in place: that one is a copy.
                state, shown = self._state.read_only, active.shown
                found = modifier(state, shown, a.copy())
                a, offset = _checked(found, self._state.robot)
            for limits, share in sets:
                one = self.actuation(active, limits).deliver(a, offset)
                if single:
                    return one
                shares.append(active.share * share)
                forces = _placed(one.forces, active.support, whole)
                # A copy: the next part overwrites them.
                parts.append(np.concatenate((one.effort, one.acceleration, forces)))
                worst = max(worst, one.status)
                relaxation = max(relaxation, one.relaxation)
        mean, nv = _mean(shares, parts), len(one.effort)
        return Delivered(
            mean[:nv], mean[nv : 2 * nv], mean[2 * nv :], worst, relaxation
        )

    def bound_step(
        self, origin: Array, evolving: Sequence[Step]
    ) -> BoundStep | BoundMixture | None:
        """Return the step as one call; None: a part of it needs Python.

        Args:
            origin: Reading of its calls' clock at time 0, shape (1,) [s].
            evolving: The calls that write changing values, at a time.
        """
        state, limits = self._state, self._limits
        if self.steady:
            ((_, stack),) = self._sets(0.0)  # at any time
            actuation = self.actuation(stack, self._steady_limits)
            return BoundStep(state, stack, actuation, limits, origin, evolving)

        def within(stack: ActiveStack, k: int) -> Actuation:
            return self.actuation(stack, limits.all[k])

        for stack in self._prepared:
            for k in range(len(limits.all)):
                each = within(stack, k)
                if not each.direct and each.carried is None:
                    return None
        fading: list[PlannedTask | PlannedContact] = [*self._fading, *self._moving]
        choice = Choice(fading, self._prepared, self._sets)
        return BoundMixture(state, choice, within, limits, origin, evolving)

    def stack_alone(self, without: Collection[str]) -> tuple[ActiveStack, Actuation]:
        """Return the stack without some tasks, and its actuation within the limits.

        Neither contacts nor limits change.
        """
        stack = self.stack_without((), without)
        return stack, self.actuation(stack, self._steady_limits)

    @property
    def _steady_limits(self) -> LimitSet:
        # Several sets may be None, one after another.
        last = self._setup.limits.last
        return next(each for each in self._limits.all if each.limits is last)

    def prepare(self, times: Iterable[float]) -> None:
        """Bind the calls of steps at some times [s], now instead of in a step."""
        for t in times:
            for _, stack in self._sets(t):
                if stack not in self._prepared:
                    self.bind(stack)
                    tasks = {each.planned.key for each in stack.stacked}
                    there = {id(each) for each in stack.contacts}
                    self._prepared[stack] = [
                        *(each.key in tasks for each in self._fading),
                        *(id(each.contact) in there for each in self._moving),
                    ]

    def rehearse(self) -> None:
        """Solve the QPs again, to fill caches; the results are unused."""
        for each in self._actuations.values():
            each.rehearse()

    def bind(self, stack: ActiveStack) -> None:
        """Bind the calls of a step with a stack."""
        stack.bind()
        for limits in self._limits.all:
            self.actuation(stack, limits)

    def actuation(self, stack: ActiveStack, limits: LimitSet) -> Actuation:
        """Return the actuation of a stack within a set of limits."""
        found = self._actuations.get((stack, limits))
        if found is None:
            found = Actuation(self._state, stack.law, stack.support, limits)
            self._actuations[stack, limits] = found
        return found

    def stack_without(
        self, lifted: Collection[str], without: Collection[str]
    ) -> ActiveStack:
        """Return the stack without the contacts and tasks of some names."""
        contacts = self._setup.contacts
        for name in lifted:  # raises if there is none
            self._setup.contact(name)
        for name in without:
            self._setup.task(name)
        standing = [each for each in contacts if each.contact.name not in lifted]
        tasks = (each for level in self.levels for each in level)
        off = {each.key for each in tasks if each.task.name in without}
        return self._stack(standing, off)

    def _stack(
        self, standing: Sequence[PlannedContact], off: Collection[int]
    ) -> ActiveStack:
        """Return the stack of some contacts and of the active tasks."""
        known = (*map(id, standing),), frozenset(off)
        found = self._active.get(known)
        if found is None:
            found = self._active[known] = self._made(standing, known[1])
        return found

    def _made(self, standing: Sequence[PlannedContact], off: Set[int]) -> ActiveStack:
        on = (each for each in self._setup.tasks if each.key not in off)
        tasks = frozenset((each.key, id(each.task)) for each in on)
        key = frozenset(map(id, standing)), tasks
        if key not in self._stacks:
            levels = [
                [each for each in level if each.key not in off] for level in self.levels
            ]
            offset = self._gains.force_offset
            support = Support(standing, self._state, self._base, offset)
            gains, metric = self._gains, self._setup.metric
            law = gains.feedback, metric, self.field, gains.null_space, self._threshold
            self._stacks[key] = ActiveStack(self._state, support, levels, *law)
        return self._stacks[key]


_ROUNDING = 1e-12
"""What is shorter is no share: times of two schedules that meet differ by rounding. As
in the engine's `ChooseSets`."""


def _mean(shares: Sequence[float], parts: Sequence[Array]) -> Array:
    """Return the weighted mean, within their range also up to rounding."""
    x = np.array(parts)
    # in this order, as the engine's
    mean = sum(share * each for share, each in zip(shares, parts, strict=True))
    mean = np.maximum(mean, x.min(axis=0))
    return np.asarray(np.minimum(mean, x.max(axis=0)))


def _placed(forces: Array, support: Support, whole: Support) -> Array:
    """Return forces of some contacts at their indices among those of all."""
    if support is whole or support.contacts == whole.contacts:
        return forces
    placed = np.zeros((whole.size // 3, 3))
    for contact, points in zip(support.contacts, support.points, strict=True):
        place = whole.points[whole.contacts.index(contact)]
        placed[place] = forces.reshape(-1, 3)[points]
    return placed.ravel()


def _levels(
    tasks: Sequence[PlannedTask], robot: Robot
) -> tuple[tuple[PlannedTask, ...], ...]:
    """Return the tasks of each level, the highest priority first."""
    levels: dict[int, list[PlannedTask]] = {}
    for each in tasks:
        levels.setdefault(priority_of(each.task, robot), []).append(each)
    return tuple(tuple(levels[priority]) for priority in sorted(levels))
