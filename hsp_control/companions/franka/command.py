"""``hsp franka-model`` and its options; slow modules are imported when it runs."""

import argparse
from pathlib import Path

from hsp_control.cli.options import AddedCommand, complete
from hsp_control.common.resources import bundled_robots


def _add_options(model: argparse.ArgumentParser) -> None:
    model.add_argument(
        "address",
        metavar="ADDRESS",
        help="of the control box, with settings as behind franka:// "
        "(hsp_control/companions/franka/page.md)",
    )
    model.add_argument("urdf", type=Path, metavar="FILE", help="the URDF to write")
    like = model.add_argument(
        "--like",
        metavar="ROBOT",
        help="keep this robot's names, frames and shapes, such as panda's",
    )
    complete(like, bundled_robots)


def _run(options: argparse.Namespace) -> int:
    from hsp_control.companions.franka.model_command import franka_model

    return franka_model(options)


FRANKA_MODEL = AddedCommand(
    help="save a Franka arm's model as a URDF", add_options=_add_options, run=_run
)
