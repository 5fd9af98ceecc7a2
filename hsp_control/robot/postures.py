"""Postures, as a person types them."""

from typing import Annotated, Literal

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ShapeError
from hsp_control.declaration.quantities import Vector
from hsp_control.robot.robot import Robot, RobotState

Posture = Annotated[Literal["start", "home"] | Vector, "posture"]
"""``start``, ``home``, the positions of the joints, shape (nv,) [rad or m], or a
configuration, shape (nq,)."""


def configuration(posture: ArrayLike | str, start: RobotState) -> Array:
    """Return the configuration of a `Posture`, shape (nq,)."""
    robot: Robot = start.robot
    if isinstance(posture, str):
        return start.q.copy() if posture == "start" else robot.home()
    given = np.asarray(posture, dtype=float)
    if given.shape == (robot.nq,):
        return np.array(robot.check_configuration(given))
    if given.shape == (robot.nv,):
        return robot.integrate(robot.neutral(), robot.check_tangent(given, "posture"))
    numbers = f"{robot.nv}" if robot.nv == robot.nq else f"{robot.nv} or {robot.nq}"
    raise ShapeError(f"a posture has shape {given.shape}; needs {numbers} numbers")
