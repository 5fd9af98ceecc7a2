"""Checks of settings that the compensators share."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.robot import Robot


def positive(value: Any, what: str) -> float:
    """Return a setting as a number greater than zero, inf included.

    Raises:
        CompensationError: If it is not such a number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise CompensationError(f"{what} is {value!r}; needs a number") from None
    if not number > 0.0:
        raise CompensationError(f"{what} is {number:g}; must be greater than 0")
    return number


def per_dof(robot: Robot, value: Any, what: str) -> Array:
    """Return a setting greater than zero for each degree of freedom, shape (nv,).

    Raises:
        CompensationError: If a number is not positive, or their count is not nv.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise CompensationError(f"{what} is {value!r}; needs numbers") from None
    if array.shape not in ((), (robot.nv,)):
        raise CompensationError(
            f"{what} has shape {array.shape}; needs one number, or one for each of the "
            f"{robot.nv} degrees of freedom of {robot.name}"
        )
    if not (array > 0.0).all():
        raise CompensationError(f"{what} is {array.tolist()}; must be greater than 0")
    return np.broadcast_to(array, (robot.nv,)).copy()


def check_fixed_base(robot: Robot, what: str) -> None:
    """Check that a motor moves every degree of freedom of the robot.

    Raises:
        CompensationError: If the robot has a free-flyer root.
    """
    if robot.unactuated:
        raise CompensationError(
            f"{what}: {robot.name} has a free-flyer root, and its contact forces are "
            f"not measured; {what} needs a robot with a fixed base"
        )
