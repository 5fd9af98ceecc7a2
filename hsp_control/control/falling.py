"""Detection of a fall, early enough for a stop."""

from math import acos, degrees

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import FallError
from hsp_control.robot import RobotState

MAX_TILT = np.radians(45.0)
"""Largest tilt of the trunk from its initial orientation [rad]."""
MIN_HEIGHT = 0.65
"""Smallest height of the centre of mass above the feet, as a share of the first one."""


class FallDetector:
    """Compares tilt and height with those of the start."""

    def __init__(self, trunk: str, feet: tuple[str, ...], state: RobotState) -> None:
        self.trunk, self._feet = trunk, feet
        self._up: Array = state.frame(trunk).rotation.T @ np.array([0.0, 0.0, 1.0])
        self._height = self._height_of(state)

    def check(self, state: RobotState) -> None:
        """Check that the robot does not fall."""
        up = float((state.frame(self.trunk).rotation @ self._up)[2])
        tilt = acos(min(max(up, -1.0), 1.0))
        if tilt > MAX_TILT:
            raise FallError(
                f"the robot falls: at t = {state.t:.3f} s {self.trunk} is tilted by "
                f"{degrees(tilt):.0f}° (at most {degrees(MAX_TILT):.0f}°)"
            )
        share = self._height_of(state) / self._height
        if share < MIN_HEIGHT:
            raise FallError(
                f"the robot falls: at t = {state.t:.3f} s its centre of mass is at "
                f"{100.0 * share:.0f} % of its first height above the feet (at least "
                f"{100.0 * MIN_HEIGHT:.0f} %)"
            )

    def _height_of(self, state: RobotState) -> float:
        lowest = min(float(state.position(foot)[2]) for foot in self._feet)
        return float(state.centroidal.position[2]) - lowest
