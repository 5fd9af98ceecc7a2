"""``hsp franka-box`` and its options; slow modules are imported when it runs."""

import argparse
from pathlib import Path

from hsp_control.cli.options import AddedCommand, add_configuration


def _add_options(box: argparse.ArgumentParser) -> None:
    add_configuration(box, "the arm: a robot's name, its URDF, ", "panda")
    box.add_argument(
        "--host",
        default="127.0.0.1",
        metavar="ADDRESS",
        help="where clients connect to, on loopback; default: 127.0.0.1",
    )
    time = box.add_mutually_exclusive_group()
    time.add_argument(
        "--lockstep",
        action="store_true",
        help="wait for each command: slow clients lose none, and runs repeat exactly",
    )
    time.add_argument(
        "--priority",
        type=int,
        metavar="LEVEL",
        help="real-time priority of the box (SCHED_FIFO), 1 to 99",
    )
    box.add_argument(
        "--deadline",
        type=float,
        default=300.0,
        metavar="US",
        help="after which a command is lost, in real time [µs]; default: 300",
    )
    box.add_argument(
        "--patience",
        type=float,
        default=0.5,
        metavar="S",
        help="after which a command is lost in lockstep [s]; default: 0.5",
    )
    box.add_argument(
        "--log",
        type=Path,
        metavar="FILE",
        help="write the true motion as a log for hsp plot and hsp view (.npz)",
    )
    box.add_argument(
        "--cut",
        type=float,
        metavar="S",
        help="cut the link after so much simulated time: states and commands get lost",
    )


def _run(options: argparse.Namespace) -> int:
    from hsp_control.companions.franka_box.box_command import franka_box

    return franka_box(options)


FRANKA_BOX = AddedCommand(
    help="serve libfranka's research interface, without a robot",
    add_options=_add_options,
    run=_run,
)
