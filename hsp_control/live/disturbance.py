"""Estimates what acts on joints besides their efforts: a stop must not sink."""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_RATE = 10.0
"""With which the estimate follows [1/s]."""
_GRAVITY = 0.2
"""Part of a joint's gravity that the model may have wrong."""
_LOAD = 1.0
"""What a load exerts on a joint at most, relative to its friction."""


class Driving(NamedTuple):
    """What drives the joints by the model, from one state to the next."""

    inertia: Array  # the mass matrix M, shape (nv, nv)
    effort: Array  # tau - h, shape (nv,) [N·m or N]
    gravity: Array  # g(q), shape (nv,) [N·m or N]


def smaller(a: Array, b: Array) -> Array:
    """Return the smaller of two velocities; 0 if they contradict each other."""
    found: Array = np.where(np.abs(a) < np.abs(b), a, b)
    return np.where(a * b > 0.0, found, 0.0)


class Disturbance:
    """A slow momentum observer: d' = K (M v' - (tau - h) - d), bounded.

    With other masses or a load that the model lacks a joint that is only damped sinks
    at d/(k M) until it is held: some tenths of a rad/s. So the safe stop compensates
    this estimate. It is at most what friction, a load and an error of the gravity may
    be, and does not get there sooner than in 1/K: what is wrong for milliseconds leaves
    little.

    Attributes:
        effort: The estimate, shape (nv,) [N·m or N]; 0 for a floating base.
    """

    def __init__(
        self, robot: Robot, settings: LiveSettings, effort: Array, period: float
    ) -> None:
        """``effort`` limits the efforts, shape (nv,), inf where unlimited."""
        self._rate = min(_RATE, 0.1 / period)
        limited = np.isfinite(effort)  # where it is not, friction is unknown
        self._bound = np.where(limited, effort, 0.0)
        self._bound *= (1.0 + _LOAD) * settings.friction
        self._judged = not robot.unactuated
        self.restart()

    def restart(self) -> None:
        """Begin at rest, without a disturbance."""
        self.effort: Array = np.zeros(self._bound.size)
        self._v: Array = np.zeros(self._bound.size)

    def update(self, v: Array, driving: Driving, passed: float) -> None:
        """Follow a new state.

        Args:
            v: Mean measured velocity of some milliseconds, shape (nv,).
            driving: What has driven the joints since the last state.
            passed: Time since then [s].
        """
        if not self._judged:
            return
        allowed = self._bound + _GRAVITY * np.abs(driving.gravity)
        part = min(self._rate * passed, 1.0)
        known = passed * (driving.effort + self.effort)
        change = driving.inertia @ (v - self._v) - known
        step = np.clip(self._rate * change, -part * allowed, part * allowed)
        self.effort = np.clip(self.effort + step, -allowed, allowed)
        self._v = v
