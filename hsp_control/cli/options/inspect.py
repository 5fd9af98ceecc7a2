"""The options of ``hsp inspect``."""

import argparse
from pathlib import Path

from hsp_control.cli.options.shared import add_strict, complete
from hsp_control.common.resources import bundled_robots


def add_inspect(inspect: argparse.ArgumentParser) -> None:
    """Add all options of `hsp inspect`."""
    robot = inspect.add_argument(
        "robot", metavar="ROBOT", help="a name, a URDF or a xacro file"
    )
    complete(robot, bundled_robots)
    inspect.add_argument(
        "args", nargs="*", metavar="NAME:=VALUE", help="arguments of a xacro file"
    )
    inspect.add_argument(
        "--fix",
        type=Path,
        metavar="FILE",
        help="write a URDF whose inertias are the nearest that a body can have",
    )
    inspect.add_argument("--json", action="store_true", help="print JSON")
    add_strict(inspect)
