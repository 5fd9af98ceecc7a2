"""What is looked at where a run begins, and not in its steps."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ConfigurationError
from hsp_control.robot import Robot

FAR = 2.0
"""An angle this many times its joint's range from the middle is no angle in rad."""
NEAR = 1.0
"""Nearer than this it is not degrees, however small the range [rad]."""


def check_angles(robot: Robot, q: Array) -> None:
    """Check that no angle is so far beyond its joint's range that it is in degrees.

    Joints without limits, continuous ones and sliding ones are not looked at.

    Args:
        robot: The robot.
        q: Configuration, shape (nq,).

    Raises:
        ConfigurationError: Names the joint, its angle and its range.
    """
    lower, upper = robot.position_limits()
    angles = robot.joint_positions(q)
    for name, unit, low, high, angle in zip(
        robot.dof_names, robot.units, lower, upper, angles, strict=True
    ):
        away = abs(angle - 0.5 * (low + high)) if np.isfinite(high - low) else 0.0
        if unit == "rad" and away > max(FAR * (high - low), NEAR):
            raise ConfigurationError(
                f"joint {name!r} is at {angle:.6g} rad, but its range is from {low:g} "
                f"to {high:g} rad: degrees? Angles are in rad"
            )
