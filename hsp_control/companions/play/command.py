"""``hsp play`` and ``hsp live --steer``, and their options.

Slow modules are imported when they run.
"""

import argparse
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING

from hsp_control.cli.options import (
    AddedCommand,
    CommandPage,
    add_configuration,
    add_import,
)
from hsp_control.common.errors import LiveError
from hsp_control.companions.viewer.command import add_page

if TYPE_CHECKING:
    from hsp_control.companions.play.steering import SteeringPage
    from hsp_control.config import Scenario

_HERE = "127.0.0.1"


def _add_play_options(play: argparse.ArgumentParser) -> None:
    add_configuration(play, "a robot's name, or ")
    add_import(play)
    play.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    _add_host(play)
    add_page(play)


def _play(options: argparse.Namespace) -> int:
    from hsp_control.companions.play.real_time import play_command

    return play_command(options)


PLAY = AddedCommand(
    help="drag and push a simulated robot in a browser",
    add_options=_add_play_options,
    run=_play,
    own_interrupts=True,  # it saves the log
    place=-4,
)


def _add_live_options(live: argparse.ArgumentParser) -> None:
    live.add_argument(
        "--steer",
        nargs="?",
        choices=("simulated", "hardware"),
        const="simulated",
        help="show a page that steers: drag targets and obstacles, turn settings; with "
        "hardware, the robot moves only while a key is held on the page",
    )
    _add_host(live)
    add_page(live)


def _open(
    options: argparse.Namespace, scenario: "Scenario"
) -> "AbstractContextManager[SteeringPage | None]":
    if options.robot is not None and options.steer == "simulated":
        raise LiveError(
            "--steer: a page that moves a real robot needs a dead-man's key; use "
            "--steer hardware"
        )
    if options.steer is None:
        if (options.port, options.host) != (None, _HERE):
            raise LiveError("--port and --host are those of a page: they need --steer")
        return nullcontext()
    from hsp_control.companions.play.steering import steering_page

    return steering_page(options, scenario)


LIVE_PAGE = CommandPage(add_options=_add_live_options, open=_open)


def _add_host(parser: argparse.ArgumentParser) -> None:
    """Add the option for the address at which a page is opened."""
    parser.add_argument(
        "--host",
        default=_HERE,
        metavar="ADDRESS",
        help="the address of this computer at which another computer or a phone opens "
        "the page; default: this computer only",
    )
