"""What computes the efforts of a live loop."""

from hsp_control.control.compensation import Command
from hsp_control.control.controller import Controller
from hsp_control.simulation.control_chain import EffortSource as EffortSource


def as_effort_source(controller: Controller | EffortSource) -> EffortSource:
    """Wrap a `Controller` as an `EffortSource`; return an `EffortSource` unchanged."""
    if isinstance(controller, Controller):
        return Command(controller)
    return controller
