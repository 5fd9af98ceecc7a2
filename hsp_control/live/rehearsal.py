"""Before a loop: what its later steps need is compiled."""

from collections.abc import Iterator
from contextlib import suppress
from itertools import islice
from math import inf

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HspControlError
from hsp_control.control.controller import Controller
from hsp_control.declaration.nested import parts_within
from hsp_control.trajectories.schedule import Schedule

_MOST = 200
"""Most instants that are rehearsed: a schedule may repeat itself for hours."""


def rehearse(
    controller: Controller, start: float, end: float, q: Array, v: Array
) -> None:
    """Evaluate a copy of a controller wherever its tasks or contacts change.

    Their native calls are compiled then, not in the loop: a robot waits no seconds.
    """
    times = sorted({t for t in _instants(controller) if start < t <= end and t < inf})
    if not times:
        return
    preview = controller.preview()
    for t in islice(times, _MOST):
        with suppress(HspControlError):  # the robot will be elsewhere then
            preview.compute(t, q, v)


def _instants(controller: Controller) -> Iterator[float]:
    """Yield when sets of tasks and contacts begin: amid ramps, and after them [s]."""
    declared = controller.tasks, controller.contacts, controller.changes
    for schedule in parts_within(declared, Schedule):
        for begin, end in schedule.windows:
            yield begin
            yield begin + 0.5 * schedule.ramp
            yield begin + schedule.ramp
            yield end - 0.5 * schedule.ramp
            yield end
    for change in controller.changes:
        yield change.at
        yield change.at + 0.5 * change.ramp
        yield change.end
