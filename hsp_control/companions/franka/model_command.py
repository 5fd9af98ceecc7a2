"""``hsp franka-model``: save a Franka arm's own model."""

import argparse

import numpy as np

from hsp_control.cli.consoles import out
from hsp_control.common.errors import ModelError
from hsp_control.companions.franka.connection import reached
from hsp_control.companions.franka.model_request import robot_urdf
from hsp_control.companions.franka.robot_model import calibrated, own_model
from hsp_control.companions.franka.settings import FrankaSettings
from hsp_control.robot import Robot


def franka_model(options: argparse.Namespace) -> int:
    """Write the robot's URDF with its end effector and load, and load it once."""
    if options.urdf.suffix != ".urdf":
        raise ModelError(f"{options.urdf}: the file's name must end in .urdf")
    settings = FrankaSettings.parse(options.address)
    process, found = reached(settings, np.empty((0, 7)), moves=False)
    process.close()
    urdf, carried = robot_urdf(settings.address), found["total"]
    if options.like is None:
        text = own_model(urdf, carried, found["flange_to_end_effector"])
    else:
        text = calibrated(urdf, carried, Robot.load(options.like))
    options.urdf.write_text(text, encoding="utf-8")
    robot = Robot.load(options.urdf)
    out.print(
        f"{options.urdf}: {robot.nv} joints, {carried['mass']:.3g} kg beyond the flange"
    )
    return 0
