"""What turns a measurement into an effort: a controller, or what stands around one."""

from typing import Protocol

from hsp_control.arrays import Array
from hsp_control.controller import Controller, ControlOutput
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


class PlainCommander:
    """A controller that takes measurements as they are."""

    def __init__(self, controller: Controller) -> None:
        """Set the controller."""
        self.controller = controller
        self.state = RobotState(controller.robot)
        self._output: ControlOutput | None = None

    @property
    def output(self) -> ControlOutput:
        """What the controller said last."""
        if self._output is None:
            self._output = self.controller.compute(self.state)
        return self._output

    def restart(self) -> None:
        """Forget the last effort."""
        self.controller.restart()

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the law's effort, shape (nv,)."""
        self._output = self.controller.compute(self.state.update(t, q, v))
        return self._output.tau


def as_commander(commander: "Controller | Commander") -> Commander:
    """Return a controller as a commander, and a commander as it is."""
    if isinstance(commander, Controller):
        return PlainCommander(commander)
    return commander
