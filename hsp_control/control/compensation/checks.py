"""A check that the compensators share."""

from hsp_control.common.exceptions import CompensationError
from hsp_control.robot import Robot


def check_fixed_base(robot: Robot) -> None:
    """Check that a motor moves every degree of freedom of the robot."""
    if robot.unactuated:
        raise CompensationError(
            f"{robot.name} has a free-flyer root, and its contact forces are not "
            "measured; needs a robot with a fixed base"
        )
