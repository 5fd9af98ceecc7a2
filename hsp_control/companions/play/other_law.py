"""The same robot with another law, stepped beside a play from the same instant.

It receives the user's targets, obstacles, settings and pulls, too. Only the law
differs, so any difference between the two robots is due to the law.
"""

from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import Any, NamedTuple

from hsp_control.common.arrays import Array
from hsp_control.companions.play.compared import ComparedController
from hsp_control.companions.play.handles import Handles
from hsp_control.companions.play.knobs import FieldSwitch
from hsp_control.companions.play.operational_space import operational_space
from hsp_control.companions.play.plain_impedance import PlainImpedance
from hsp_control.control.interface import NO_WRENCHES, Controller
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.loops import Instant, sampled_loop
from hsp_control.simulation.plants import SampledPlant
from hsp_control.tasks.compliant_task import impedance_of

WITHOUT_FIELD = "no field"
OPERATIONAL = "operational-space law"
PLAIN = "plain impedance (JᵀK)"
EXACT = "exact law"


def laws_beside(controller: Controller, *, operational: bool) -> list[str]:
    """Return the laws that can be compared with a running one; none without a field."""
    if not controller.field.controls:
        return []
    without = [WITHOUT_FIELD] if FieldSwitch(controller.field).whole else []
    plain = [PLAIN] if _has_gains_only(controller) else []
    return [*without, EXACT if operational else OPERATIONAL, *plain]


def _has_gains_only(controller: Controller) -> bool:
    """Return whether the base is fixed, without contacts, and no task is a spring."""
    springs = any(impedance_of(task) is not None for task in controller.tasks)
    on_contacts = controller.contacts or controller.robot.unactuated
    return bool(controller.tasks) and not (springs or on_contacts)


class Playing(NamedTuple):
    """The parts of a play that are stepped; the other law has copies of them."""

    compensated: ComparedController
    handles: Handles
    plant: SampledPlant


class OtherLaw:
    """A copy of a play's robot and controller with another law.

    Attributes:
        law: The name of its law.
        controller: Its controller, in whose state the robot is.
        handles: Its handles; see `receive`.
    """

    def __init__(
        self,
        law: str,
        playing: Playing,
        times: Sequence[float],
        periods: int,
        shared: object,
    ) -> None:
        """Begin at the present state of a play.

        Args:
            law: The name of the law.
            playing: The parts of the play.
            times: The times of its rows, the present one first [s].
            periods: How many control periods a row has.
            shared: An object to which copied parts may refer, and which is not copied:
            the play.
        """
        self.law = law
        state = playing.compensated.controller.state
        kept = playing.compensated.controller.robot, NO_WRENCHES, shared
        memo: dict[int, Any] = {id(each): each for each in kept}
        compensated, self.handles, self.plant = deepcopy(playing, memo)
        self.controller = compensated.controller
        if law == WITHOUT_FIELD:
            switch = FieldSwitch(self.controller.field)
            switch.turn(self.controller.at(times[0]), on=False)
        else:
            compensated.compared = {
                EXACT: None, OPERATIONAL: operational_space, PLAIN: PlainImpedance()
            }[law]  # fmt: skip
        self._loop: Iterator[Instant] = sampled_loop(
            ControlChain(compensated), self.plant, periods, times,
            state.q.copy(), state.v.copy(),
        )  # fmt: skip
        self.advance()

    def advance(self) -> bool:
        """Advance to the next row; return whether that succeeded."""
        instant = next(self._loop, None)
        self.handles.turn_knobs()
        return instant is not None

    def receive(self, message: Mapping[str, Any]) -> None:
        """Execute a page's command; the session reports a refusal."""
        self.handles.receive(message)

    @property
    def q(self) -> Array:
        """Its configuration, shape (nq,)."""
        return self.controller.state.q
