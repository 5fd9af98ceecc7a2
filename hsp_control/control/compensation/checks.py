"""What settings of all compensation have in common."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.robot import Robot


def positive(value: Any, what: str) -> float:
    """Return a setting that is greater than zero, inf included.

    Raises:
        CompensationError: If it is not.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise CompensationError(f"{what} is {value!r}; needs a number") from None
    if not number > 0.0:
        raise CompensationError(f"{what} is {number:g}; must be greater than 0")
    return number


def per_dof(robot: Robot, value: Any, what: str) -> Array:
    """Return a setting greater than zero for each freedom, shape (nv,).

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
            f"{robot.nv} freedoms of {robot.name}"
        )
    if not (array > 0.0).all():
        raise CompensationError(f"{what} is {array.tolist()}; must be greater than 0")
    return np.broadcast_to(array, (robot.nv,)).copy()


def refuse_floating_base(robot: Robot, what: str) -> None:
    """Refuse a robot with a root that no motor moves.

    Raises:
        CompensationError: If it has one.
    """
    if robot.unactuated:
        raise CompensationError(
            f"{what}: {robot.name} has a free-flyer root, and the forces of its "
            "contacts are not measured; only robots on a fixed base can have one"
        )
