"""The law while tasks fade in and out: a mixture of the law for each set of tasks."""

from collections.abc import Collection, Sequence, Set
from itertools import pairwise

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation
from hsp_control.control.gains_in_force import GainsInForce
from hsp_control.control.planned_contact import PlannedContact
from hsp_control.control.setup import PlannedTask, Setup, levels_of
from hsp_control.law import Outcome
from hsp_control.law.outcome import DAMPED, EXACT
from hsp_control.robot import RobotState


class Mixture:
    """Resolves the law for the contacts and tasks that count at a time.

    Attributes:
        active: The stack that was resolved last, with the fewest tasks of a mixture;
            None before.
        damped: The tasks of the first level with a bounded inverse in the last
            `resolve`, by name; empty: none.
        steady: Whether it is the same at all times.
        levels: The tasks of each level, the highest priority first.
        field: The field, placed.
    """

    active: ActiveStack | None
    steady: bool
    levels: tuple[tuple[PlannedTask, ...], ...]

    def __init__(
        self,
        state: RobotState,
        actuation: Actuation,
        gains: GainsInForce,
        setup: Setup,
        threshold: float,
    ) -> None:
        """Allocate.

        Args:
            state: The state that every step reads.
            actuation: What delivers the results.
            gains: The gains in force.
            setup: The setup.
            threshold: Singular value below which an inverse is bounded.
        """
        self._state, self._actuation = state, actuation
        self._gains, self._threshold = gains, threshold
        self._stacks: dict[tuple[frozenset[int], frozenset[int]], ActiveStack] = {}
        self._sum = np.zeros(state.robot.nv)
        self.damped = ""
        self.field = setup.field
        self.plan(setup, exchanged=False)

    def plan(self, setup: Setup, *, exchanged: bool) -> None:
        """Follow a setup from now on; what stays the same is not compiled again.

        Args:
            setup: The setup.
            exchanged: Whether one of the tasks has become another.
        """
        field = setup.field
        if exchanged or field != self.field:
            self._stacks.clear()
            self.field = field
        self._setup = setup
        there = {id(each) for each in setup.contacts}
        for key in [key for key in self._stacks if not key[0] <= there]:
            del self._stacks[key]
        self._fading = [each for each in setup.tasks if not each.always]
        self.levels = levels_of(setup.tasks, self._state.robot)
        self.steady = setup.steady and setup.end == -np.inf
        self.active = None

    def resolve(self, t: float) -> tuple[Array, Outcome]:
        """Return the law's acceleration for the tasks that are active, and its outcome.

        A task that fades in or out has a weight between 0 and 1. With w1 ≥ w2 ≥ ... the
        weights of such tasks, the acceleration is

            (1 - w1) a{} + (w1 - w2) a{1} + (w2 - w3) a{1, 2} + ...

        with a{...} the law for the tasks of weight 1 and those in the braces. It is
        continuous in the weights. The rows of the tasks in all sets are linear in a, so
        that these tasks keep their exact error equation throughout.

        Args:
            t: The time of the state [s].
        """
        weights = {each.key: each.weight(t) for each in self._fading}
        coming = sorted(
            (key for key, w in weights.items() if 0.0 < w < 1.0),
            key=lambda key: -weights[key],
        )
        off = {key for key, w in weights.items() if w < 1.0}
        shares = [1.0, *(weights[key] for key in coming), 0.0]
        mixed = self._sum
        mixed[:] = 0.0
        outcome, self.damped = EXACT, ""
        for k, (share, following) in enumerate(pairwise(shares)):
            self.active = active = self.stack_at(t, off - set(coming[:k]))
            found = active.resolve(t)
            if found > outcome:
                outcome = found
                self.damped = active.damped if found is DAMPED else ""
            a = active.resolution.acceleration
            if not coming:
                break
            mixed += (share - following) * a
            a = mixed
        return a, outcome

    def prepare(self, stack: ActiveStack) -> None:
        """Compile what a step with a stack calls, now instead of in the step."""
        stack.calls  # noqa: B018 (compiled, and kept)
        self._actuation.prepare(self._state, stack.resolution, stack.support)

    def stack_at(self, t: float, off: Set[int] = frozenset()) -> ActiveStack:
        """Return the stack of the contacts that bear at a time, without some tasks.

        Args:
            t: The time [s].
            off: The keys of the tasks that do not count.
        """
        bearing = [each for each in self._setup.contacts if each.active(t)]
        return self._stack(bearing, off)

    def stack_without(
        self, lifted: Collection[str], without: Collection[str]
    ) -> ActiveStack:
        """Return the stack without the contacts and tasks of some names."""
        contacts = self._setup.contacts
        bearing = [each for each in contacts if each.contact.name not in lifted]
        tasks = (each for level in self.levels for each in level)
        off = {each.key for each in tasks if each.task.name in without}
        return self._stack(bearing, off)

    def _stack(self, bearing: Sequence[PlannedContact], off: Set[int]) -> ActiveStack:
        on = frozenset(each.key for each in self._setup.tasks if each.key not in off)
        # By identity: to compare values would cost more than the step.
        key = frozenset(map(id, bearing)), on
        if key not in self._stacks:
            levels = [
                [each for each in level if each.key in on] for level in self.levels
            ]
            actuation = self._actuation
            stack = ActiveStack(
                self._state,
                actuation.support(bearing),
                levels,
                self._gains.feedback,
                actuation.base,
                self._setup.metric,
                self.field,
                self._gains.null_space,
                self._threshold,
            )
            actuation.prepare(self._state, stack.resolution, stack.support)
            self._stacks[key] = stack
        return self._stacks[key]
