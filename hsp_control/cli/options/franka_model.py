"""The options of ``hsp franka-model``, apart: a help text has to come at once."""

import argparse
from pathlib import Path


def add_model_options(model: argparse.ArgumentParser) -> argparse.Action:
    """Add all options; return the one that names a robot."""
    model.add_argument(
        "address",
        metavar="ADDRESS",
        help="of the control box, with settings as behind franka:// (docs/franka.md)",
    )
    model.add_argument("urdf", type=Path, metavar="FILE", help="the URDF to write")
    return model.add_argument(
        "--like",
        metavar="ROBOT",
        help="keep this robot's names, frames and shapes, such as panda's",
    )
