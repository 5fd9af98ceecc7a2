"""``hsp inspect`` and its options; slow modules are imported when it runs."""

import argparse
from pathlib import Path

from hsp_control.cli.options import AddedCommand, add_import, add_strict, complete
from hsp_control.common.resources import bundled_robots


def _add_options(inspect: argparse.ArgumentParser) -> None:
    robot = inspect.add_argument(
        "robot", metavar="ROBOT", help="a name, a URDF, a xacro file or an MJCF"
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
    add_import(inspect)
    add_strict(inspect)


def _run(options: argparse.Namespace) -> int:
    from hsp_control.companions.inspection.inspect_command import inspect

    return inspect(options)


INSPECT = AddedCommand(
    help="report implausible values in a robot's URDF or MJCF",
    add_options=_add_options,
    run=_run,
    place=1,
)
