"""The same robot with another law, stepped beside a play from the same instant.

What hands do to the robot is done to it, too: targets, obstacles, settings and pulls.
Only the law differs, so what is seen between the two is the law's.
"""

from collections.abc import Iterator, Mapping
from copy import deepcopy
from typing import TYPE_CHECKING, Any

from hsp_control.common.arrays import Array
from hsp_control.companions.play.handles import Handles
from hsp_control.companions.play.knobs import FieldSwitch
from hsp_control.control.controller import Controller
from hsp_control.control.measurement import NO_WRENCHES
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.loops import Instant, sampled_loop
from hsp_control.simulation.plants import SampledPlant

if TYPE_CHECKING:
    from hsp_control.companions.play.operational_space import ComparedCommand
    from hsp_control.companions.play.session import Session

WITHOUT_FIELD = "no field"
OPERATIONAL = "operational-space law"
EXACT = "exact law"


def laws_beside(controller: Controller, *, operational: bool) -> list[str]:
    """Return the laws that can be compared with a running one; none without a field."""
    if not controller.field.controls:
        return []
    without = [WITHOUT_FIELD] if FieldSwitch(controller.field).whole else []
    return [*without, EXACT if operational else OPERATIONAL]


class OtherLaw:
    """A copy of a session's robot and controller with another law.

    Attributes:
        law: The name of its law.
        controller: Its controller, in whose state the robot is.
        handles: What hands move; see `receive`.
    """

    def __init__(self, session: "Session", law: str) -> None:
        """Begin where the session is, with the law from there on."""
        self.law = law
        robot = session.robot
        shared = robot, session, NO_WRENCHES
        memo: dict[int, Any] = {id(each): each for each in shared}
        copied = deepcopy((session.command, session.handles, session.plant), memo)
        command: ComparedCommand = copied[0]
        self.handles: Handles = copied[1]
        self.plant: SampledPlant = copied[2]
        self.controller = command.controller
        if law == WITHOUT_FIELD:
            switch = FieldSwitch(self.controller.field)
            switch.turn(self.controller.at(session.t), on=False)
        else:
            command.operational = law == OPERATIONAL
        state = session.controller.state
        times = [session.t + k * session.row for k in range(session.rows_left)]
        self._loop: Iterator[Instant] = sampled_loop(
            ControlChain(command), self.plant, round(session.row / session.period),
            times, state.q.copy(), state.v.copy(),
        )  # fmt: skip
        self.advance()

    def advance(self) -> bool:
        """Go on to the next row; return whether it could."""
        instant = next(self._loop, None)
        self.handles.turn_knobs()
        return instant is not None

    def receive(self, message: Mapping[str, Any]) -> None:
        """Do what a page says, as the session does; what it refuses is said there."""
        self.handles.receive(message)

    @property
    def q(self) -> Array:
        """Its configuration, shape (nq,)."""
        return self.controller.state.q
