"""What turns a measurement into an effort: a controller, or what stands around one."""

from typing import Protocol

from hsp_control.common.arrays import Array
from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller, ControlOutput
from hsp_control.robot import RobotState


class Commander(Protocol):
    """The narrow side of whatever computes a loop's efforts.

    Attributes:
        controller: The law.
        output: What the controller said last.
        state: The state that it said it of.
    """

    @property
    def controller(self) -> Controller:
        """The law."""

    @property
    def output(self) -> ControlOutput:
        """What the controller said last."""

    @property
    def state(self) -> RobotState:
        """The state that it said it of."""

    def restart(self) -> None:
        """Forget all that came before: what follows is another run."""

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the effort, shape (nv,), for a measurement at time t [s].

        Args:
            t: Time [s].
            q: Configuration as measured, shape (nq,).
            v: Velocity as measured, shape (nv,).
            period: How long the effort will be held [s].
        """

    def applied(self, tau: Array, period: float) -> None:
        """Take note of the effort that acts in fact, and of when the next one will."""


def as_commander(commander: "Controller | Commander") -> Commander:
    """Return a controller as a commander, and a commander as it is."""
    if isinstance(commander, Controller):
        return Command(commander)
    return commander
