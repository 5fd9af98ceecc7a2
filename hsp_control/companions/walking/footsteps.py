"""Footsteps in the plane: places of the feet, and the next place at a velocity."""

from math import cos, pi, sin
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array


class Footstep(NamedTuple):
    """The place of a foot on the ground: x and y [m], and its yaw [rad]."""

    x: float
    y: float
    yaw: float

    @property
    def point(self) -> Array:
        """X and y, shape (2,) [m]."""
        return np.array([self.x, self.y])

    def ahead(self, forward: float, left: float, turn: float = 0.0) -> "Footstep":
        """Return the step this far forward and left [m], turned by an angle [rad]."""
        c, s = cos(self.yaw), sin(self.yaw)
        return Footstep(
            self.x + c * forward - s * left,
            self.y + s * forward + c * left,
            self.yaw + turn,
        )

    def local(self, point: Array) -> Array:
        """Return a point of the ground in the foot's axes, shape (2,) [m]."""
        c, s = cos(self.yaw), sin(self.yaw)
        x, y = point[0] - self.x, point[1] - self.y
        return np.array([c * x + s * y, -s * x + c * y])

    def world(self, point: Array) -> Array:
        """Return a point of the foot's axes in the world, shape (2,) [m]."""
        return self.ahead(float(point[0]), float(point[1])).point


class Velocity(NamedTuple):
    """The velocity of the body forward and to the left [m/s], and turning [rad/s]."""

    forward: float
    left: float
    turn: float

    @property
    def is_zero(self) -> bool:
        """Whether it stands."""
        return self.forward == self.left == self.turn == 0.0

    def towards(
        self, wanted: "Velocity", most: tuple[float, float, float]
    ) -> "Velocity":
        """Return the velocity nearest to a desired one, with bounded changes."""
        parts = zip(self, wanted, most, strict=True)
        return Velocity(*(a + min(max(b - a, -m), m) for a, b, m in parts))


class Stance(NamedTuple):
    """The geometry of a biped's stance.

    Attributes:
        width: From the right to the left foot, when it stands [m].
        narrowest: The smallest distance of the feet across the walk [m].
        widest: The largest one [m].
        longest: The longest step along the walk, from the standing foot [m].
    """

    width: float
    narrowest: float
    widest: float
    longest: float

    def next(
        self, standing: Footstep, side: float, velocity: Velocity, duration: float
    ) -> Footstep:
        """Return the footstep of the swing foot at a velocity of the body.

        The middle between the feet advances with the velocity, and the foot is placed
        beside it: not nearer to the stance foot than the width of the feet, nor beyond
        the reach of the legs.
        """
        turn = velocity.turn * duration
        middle = standing.ahead(0.0, 0.5 * side * self.width)
        along = velocity.forward * duration, velocity.left * duration
        foot = middle.ahead(*along, turn).ahead(0.0, 0.5 * side * self.width)
        return self.kept(standing, side, foot)

    def kept(self, standing: Footstep, side: float, foot: Footstep) -> Footstep:
        """Return the nearest footstep that the other foot permits."""
        x, y = standing.local(foot.point)
        x = min(max(float(x), -self.longest), self.longest)
        y = side * min(max(side * float(y), self.narrowest), self.widest)
        place = standing.world(np.array([x, y]))
        return Footstep(float(place[0]), float(place[1]), foot.yaw)


def between(a: Footstep, b: Footstep) -> Footstep:
    """Return the middle of two feet; its yaw is near that of the first."""
    yaw = 0.5 * (a.yaw + near(b.yaw, a.yaw))
    return Footstep(0.5 * (a.x + b.x), 0.5 * (a.y + b.y), yaw)


def near(yaw: float, reference: float) -> float:
    """Return an angle plus those full turns that bring it nearest to another [rad]."""
    return yaw + 2.0 * pi * round((reference - yaw) / (2.0 * pi))
