"""The interface of what computes an effort from a measurement."""

from collections.abc import Mapping
from typing import Protocol

from hsp_control.common.arrays import Array
from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller
from hsp_control.control.log_channel import LogChannel
from hsp_control.control.output import ControlOutput
from hsp_control.robot import RobotState


class EffortSource(Protocol):
    """Computes the efforts of a live loop: a controller, or a wrapper around one.

    Attributes:
        controller: The controller.
        output: The controller's last output.
        state: The state for which the controller computed it.
    """

    @property
    def controller(self) -> Controller:
        """The controller."""

    @property
    def output(self) -> ControlOutput:
        """The controller's last output."""

    @property
    def state(self) -> RobotState:
        """The state for which the controller computed it."""

    def restart(self) -> None:
        """Clear all memory: a new run begins."""

    def effort(self, t: float, q: Array, v: Array, period: float) -> Array:
        """Return the effort, shape (nv,), for a measurement at time t [s].

        Args:
            t: Time [s].
            q: Measured configuration, shape (nq,).
            v: Measured velocity, shape (nv,).
            period: How long the effort will be held [s].
        """

    def applied(self, tau: Array, period: float) -> None:
        """Record the effort, shape (nv,), that the motors really apply.

        Args:
            tau: The effort after all limits, shape (nv,).
            period: Time until the next effort [s].
        """

    def log_channels(self) -> Mapping[str, LogChannel]:
        """Return what it logs of the last effort besides the controller, by name."""


def as_effort_source(controller: "Controller | EffortSource") -> EffortSource:
    """Wrap a `Controller` as an `EffortSource`; return an `EffortSource` unchanged."""
    if isinstance(controller, Controller):
        return Command(controller)
    return controller
