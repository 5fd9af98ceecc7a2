"""Checks that the compensators share."""

from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError, LimitError
from hsp_control.constraints.limits.numbers_by_joint import by_dof
from hsp_control.robot import Robot


def per_dof(robot: Robot, numbers: Any) -> Array:
    """Return a bound for each degree of freedom, shape (nv,); inf where there is none.

    Args:
        robot: The robot.
        numbers: One number, or nv numbers; None is no bound.

    Raises:
        CompensationError: If there are neither one nor nv numbers.
    """
    try:
        return by_dof(numbers, robot.nv)
    except LimitError as error:
        raise CompensationError(error.bare_message) from None


def check_fixed_base(robot: Robot) -> None:
    """Check that a motor moves every degree of freedom of the robot.

    Raises:
        CompensationError: If the robot has a free-flyer root.
    """
    if robot.unactuated:
        raise CompensationError(
            f"{robot.name} has a free-flyer root, and its contact forces are not "
            "measured; needs a robot with a fixed base"
        )
