"""A step of the same tasks and contacts: state, references, law, limits in one call."""

from collections.abc import Sequence
from functools import cached_property
from typing import NamedTuple

from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.control.active_stack import ActiveStack
from hsp_control.control.actuation import Actuation, Delivered
from hsp_control.control.actuation.limit_checks import LimitsOutcome
from hsp_control.control.actuation.limited_step import BEYOND, RELAXED
from hsp_control.control.actuation.limits_in_force import LimitsInForce
from hsp_control.engine import Move
from hsp_control.engine.plans import Step
from hsp_control.law.outcome import LawOutcome
from hsp_control.robot import RobotState


class BoundStep:
    """A step of the same tasks, contacts and limits, from the state on, as one call.

    It reads gains, K_N, payloads and tools where they are in force; while these change,
    it begins with the calls that write them.
    """

    def __init__(
        self,
        state: RobotState,
        active: ActiveStack,
        actuation: Actuation,
        limits: LimitsInForce,
        origin: Array,
        evolving: Sequence[Step] = (),
    ) -> None:
        self.active, self.resolved = active, [active]
        self.damped = ""  # tasks of the first level with a bounded inverse, by name
        # whether the effort is M a + N wherever no limit is violated
        self.direct = actuation.direct
        calls = [*evolving, *active.calls, *actuation.calls]
        self.move = state.bind_move(calls, origin)
        self._move = self.move.__call__  # bound once: half the time of a look-up
        self._own = actuation.own  # the result for the law's own acceleration
        self._nearest, self._is_nearest = actuation.nearest, actuation.is_nearest
        self.state, self.actuation, self.limits = state, actuation, limits
        self._law_outcome = active.law.outcome
        self._limits_outcome = actuation.outcome

    def make(self, t: float, q: ArrayLike, v: ArrayLike) -> Delivered:
        """Move to a state; return the result there.

        The move makes all calls of a step, up to the law's own effort M a + N and the
        check of the limits; the last one, `IsPlain`, returns whether that is the result
        as it is. Else the QP may have been solved at once; if not, it is looked at why.
        """
        plain = self._move(t, q, v)
        if plain is None:  # rejected: lists, for example, or invalid values
            plain = self.state.advance(self.move, t, q, v)
        self.damped = ""
        return self._own if plain and self.direct else self._looked_at()

    def _looked_at(self) -> Delivered:
        """Return the result of a step in which the law's acceleration is limited."""
        if self._is_nearest.item():
            return self._nearest
        active, law, limits = self.active, self._law_outcome, self._limits_outcome
        if not law.finite.item():
            active.raise_not_finite()
        if law.damped_level.item():
            self.damped = active.damped
        if self.direct and not (limits.violated.item() or limits.beyond.item()):
            return self._own
        carried = self.actuation.carried
        if carried is not None and not carried.delivered.delivered.item():
            active.raise_not_finite()
        delivered = self.actuation.delivered(active.acceleration)
        status = delivered.status
        if status is RELAXED or status is BEYOND:
            active.check(delivered.effort)  # the engine has checked all others
        return delivered

    @cached_property
    def free(self) -> "FreeStep | None":
        """The same for the engine's loop; None if a step needs Python."""
        if self.active.streamed or not self.direct:
            return None
        sending = self.limits.applying(self.active.acceleration)
        law, limits = self._law_outcome, self._limits_outcome
        return FreeStep(self.move, law, limits, self.state.effort, sending)


class FreeStep(NamedTuple):
    """`compute` and `applied` of a controller where no limit is violated."""

    # writes the effort, the acceleration and the outcomes of the law and the limits
    move: Move
    law: LawOutcome
    limits: LimitsOutcome
    effort: Array  # M a + N, shape (nv,) [N·m or N]
    # calls at a time that record this effort as held from now on, for the period of the
    # last `Controller.applied`
    sending: Sequence[Step]
