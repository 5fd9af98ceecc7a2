"""The options of ``hsp live``."""

import argparse
from pathlib import Path

from hsp_control.cli.options.shared import add_configuration, add_host, add_page


def add_live(live: argparse.ArgumentParser) -> None:
    """Add all options of `hsp live`."""
    add_configuration(live)
    live.add_argument(
        "--robot",
        metavar="NAME://ADDRESS",
        help="franka://ADDRESS, or another robot that an installed package can reach; "
        "default: a simulated one",
    )
    live.add_argument("--publish", metavar="ros2://NAME", help="topics for watchers")
    live.add_argument(
        "--duration",
        type=float,
        metavar="S",
        help="default: the configuration's; inf: until Ctrl-C",
    )
    live.add_argument(
        "--faults",
        default="",
        metavar="KIND=P,...",
        help="probabilities of late, lost, duplicated and corrupted packets, in both "
        "directions; delay=PACKETS of late ones, and seed=N",
    )
    live.add_argument(
        "--kill",
        metavar="WHO=S",
        help="kill the process of the robot or of the controller after so long",
    )
    live.add_argument(
        "--out", type=Path, default=Path("out"), metavar="DIR", help="default: out"
    )
    live.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority of the loop (SCHED_FIFO), 1 to 99",
    )
    live.add_argument(
        "--steer",
        nargs="?",
        choices=("simulated", "hardware"),
        const="simulated",
        help="show a page that steers: drag targets and obstacles, turn settings; with "
        "hardware, the robot moves only while a key is held on the page",
    )
    add_host(live)
    add_page(live)
