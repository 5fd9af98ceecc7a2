"""``hsp live --steer``: a page that shows a live loop, and steers it."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from time import sleep
from typing import Any

from hsp_control.cli.consoles import out
from hsp_control.cli.live_experiment import live_period
from hsp_control.cli.page_process import PageProcess
from hsp_control.common.exceptions import ViewerError
from hsp_control.config import Experiment
from hsp_control.control.controller import Controller
from hsp_control.live import OperatorRequests
from hsp_control.play.dead_mans_key import DeadMansKey
from hsp_control.play.handles import Handles
from hsp_control.play.steered_loop import SteeredLoop
from hsp_control.visualization.viewer import browser

_REHEARSAL = 0.5
"""Time of a rehearsal [s]: beyond the ramps of changes."""
_POLL = 0.02


@contextmanager
def steering_page(
    options: argparse.Namespace, experiment: Experiment, journal: Path
) -> Iterator[PageProcess | None]:
    """Yield the process of the page, if there is to be one, with its address printed.

    Args:
        options: The command's.
        experiment: What the loop controls.
        journal: The loop's journal.

    Raises:
        ViewerError: If it does not start.
    """
    if options.steer is None:
        yield None
        return
    with PageProcess(
        experiment,
        journal,
        port=options.port,
        host=options.host,
        held=options.steer == "hardware",
    ) as page:
        out.print(f"Steer: {page.url}", soft_wrap=True)
        if options.browser:
            browser.open_browser(page.url)
        yield page


def let_steer(
    page: PageProcess, experiment: Experiment, requests: OperatorRequests
) -> Callable[[float], object]:
    """Return what the loop does in the rest of each period, so that the page steers.

    With a dead-man's key it returns when the key is held for the first time, or when
    the operator stops.

    Raises:
        ViewerError: If the page's process ends before its key was ever held.
    """
    controller, period = experiment.controller, live_period(experiment)
    controller.compute(0.0, experiment.q0, experiment.v0)
    _rehearse(controller, period, experiment)
    page.begin()
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
