"""What is measured of a robot at one time."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import NamedTuple

from hsp_control.common.arrays import Array

NO_WRENCHES: Mapping[str, Array] = MappingProxyType({})
"""Of a robot that measures no contact."""


class Measurement(NamedTuple):
    """What is measured at one time: all that a plan knows of the robot.

    The pose and the twist of a floating base are the first entries of q and v.
    """

    t: float
    """Time [s]."""
    q: Array
    """Configuration, shape (nq,) [rad or m]."""
    v: Array
    """Velocity, shape (nv,) [rad/s or m/s]."""
    wrenches: Mapping[str, Array] = NO_WRENCHES
    """What the world exerts on the robot at each contact, by the name of its frame:
    force and moment about the frame's origin, world axes, shape (6,) [N, N·m]; of the
    period that ends now. Frames without a sensor are missing."""

    def normal_force(self, frame: str, normal: Array) -> float | None:
        """Return how hard the world pushes on a frame along a normal [N].

        None if the frame has no sensor.
        """
        wrench = self.wrenches.get(frame)
        return None if wrench is None else float(normal @ wrench[:3])
