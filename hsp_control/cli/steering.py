"""``hsp live --steer``: a page that shows a live loop, and steers it."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from time import sleep
from typing import Any, NamedTuple

from hsp_control.cli.consoles import out
from hsp_control.cli.live_experiment import live_period
from hsp_control.cli.opening_page import OpeningPage
from hsp_control.cli.page_process import PageProcess
from hsp_control.common.exceptions import ViewerError
from hsp_control.config import Experiment, Scenario
from hsp_control.control.controller import Controller
from hsp_control.live import OperatorRequests
from hsp_control.play.dead_mans_key import DeadMansKey
from hsp_control.play.handles import Handles
from hsp_control.play.steered_loop import SteeredLoop

_REHEARSAL = 0.5
"""Time of a rehearsal [s]: beyond the ramps of changes."""
_POLL = 0.02


class SteeringPage(NamedTuple):
    """A page that shows a live loop."""

    process: PageProcess
    opening: OpeningPage  # what opens it


@contextmanager
def steering_page(
    options: argparse.Namespace, scenario: Scenario
) -> Iterator[SteeringPage | None]:
    """Yield the page, if there is to be one; it shows the robot and the scene.

    It opens when a kernel has to be compiled, or when `let_steer` is called.
    """
    if options.steer is None:
        yield None
        return
    held = options.steer == "hardware"
    with PageProcess(port=options.port, host=options.host, held=held) as process:
        process.prepare(scenario)
        opening = OpeningPage(
            process.url,
            options,
            lambda url: out.print(f"Steer: {url}", soft_wrap=True),
            process.say,
        )
        with opening.compiling():
            yield SteeringPage(process, opening)


def let_steer(
    steering: SteeringPage,
    experiment: Experiment,
    requests: OperatorRequests,
    journal: Path,
) -> Callable[[float], object]:
    """Return what the loop does in the rest of each period, so that the page steers.

    With a dead-man's key it returns when the key is held for the first time, or when
    the operator stops.
    """
    controller, period = experiment.controller, live_period(experiment)
    controller.compute(0.0, experiment.q0, experiment.v0)
    _rehearse(controller, period, experiment)
    steering.opening.ready()
    page = steering.process
    page.begin(experiment, journal)
    key = DeadMansKey() if page.held else None
    loop = SteeredLoop(controller, period, page.channel, requests, key=key)
    if key is not None:
        out.print(
            "It begins when the key is held: the space bar, or the page's button."
        )
        while not key.held and requests.reason is None:
            loop.listen()
            loop.tell()
            sleep(_POLL)
        if page.channel.lost:
            raise ViewerError(
                "the loop's page has ended before anybody held its key; the loop did "
                "not begin"
            )
    return loop.on_period


def _rehearse(controller: Controller, period: float, experiment: Experiment) -> None:
    """Do with a copy all that a page can do: nothing is compiled in the loop."""
    memo: dict[int, Any] = {id(controller.robot): controller.robot}
    copy = deepcopy(controller, memo)
    handles = Handles(copy, period)
    handles.rehearse()
    for k in range(round(_REHEARSAL / period)):
        copy.compute(k * period, experiment.q0, experiment.v0)
        handles.turn_knobs()
