"""What settings of all remedies have in common."""

from typing import Any

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import RemedyError
from hsp_control.robot import Robot


def positive(value: Any, what: str) -> float:
    """Return a setting that is greater than zero, inf included.

    Raises:
        RemedyError: If it is not.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        raise RemedyError(f"{what} is {value!r}; needs a number") from None
    if not number > 0.0:
        raise RemedyError(f"{what} is {number:g}; must be greater than 0")
    return number


def per_freedom(robot: Robot, value: Any, what: str) -> Array:
    """Return a setting greater than zero for each freedom, shape (nv,).

    Raises:
        RemedyError: If a number is not greater than zero, or their count is not nv.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise RemedyError(f"{what} is {value!r}; needs numbers") from None
    if array.shape not in ((), (robot.nv,)):
        raise RemedyError(
            f"{what} has shape {array.shape}; needs one number, or one for each of the "
            f"{robot.nv} freedoms of {robot.name}"
        )
    if not (array > 0.0).all():
        raise RemedyError(f"{what} is {array.tolist()}; must be greater than 0")
    return np.broadcast_to(array, (robot.nv,)).copy()


def refuse_floating_base(robot: Robot, what: str) -> None:
    """Refuse a robot with a root that no motor moves.

    Raises:
        RemedyError: If it has one.
    """
    if robot.unactuated:
        raise RemedyError(
            f"{what}: {robot.name} has a free-flyer root, and the forces of its "
            "contacts are not measured; only robots on a fixed base can have one"
        )
