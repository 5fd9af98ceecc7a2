"""Detects changes of momentum that neither efforts nor contacts explain."""

from math import ceil
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_JUMP, _PUSH = 0.003, 0.05
"""Times over which changes are compared [s]: of a jump, and of a push."""
_LAG = 0.05
"""Maximum lag of a velocity [s]: a delay of 5 ms and a filter of 20 Hz."""
_MASSES = 0.25
"""Tolerance of the masses, relative to the model's."""
_GRAVITY = 0.2
"""Tolerance of a joint's gravity, relative to the model's."""
_FEW = 2
"""Number of velocities averaged against noise in the detection of jumps."""
_GAP = 3.5
"""Number of periods without a state across which nothing is compared."""


class Driving(NamedTuple):
    """The terms that drive the joints by the model, from one state to the next."""

    inertia: Array  # the mass matrix M, shape (nv, nv)
    effort: Array  # tau - h, shape (nv,) [N·m or N]
    gravity: Array  # g(q), shape (nv,) [N·m or N]


def smaller(a: Array, b: Array) -> Array:
    """Return the smaller of two velocities; 0 if they contradict each other."""
    found: Array = np.where(np.abs(a) < np.abs(b), a, b)
    return np.where(a * b > 0.0, found, 0.0)


class _Window:
    """Changes of momentum over an interval, and the impulses of efforts."""

    def __init__(self, states: int, lag: int, nv: int) -> None:
        self.states = states
        self._velocities = np.zeros((states + 1, 2, nv))
        self._efforts = np.zeros((states, nv))
        self._impulses = np.zeros((lag, nv))
        self.restart()

    def restart(self) -> None:
        """Forget all states."""
        self._count = 0
        self.impulse = np.zeros(self._impulses.shape[1])
        self._impulses[:] = 0.0
        self._efforts[:] = 0.0

    def add(self, v: Array, impulse: Array) -> Array | None:
        """Add a state.

        Args:
            v: The velocity from two sources, shape (2, nv).
            impulse: That of the efforts since the last one, shape (nv,).

        Returns:
            The smaller change of the two in this time, 0 where they have different
            signs, shape (nv,); None until it has passed.
        """
        k = self._count
        self.impulse = self.impulse + impulse - self._efforts[k % self.states]
        self._efforts[k % self.states] = impulse
        self._impulses[k % len(self._impulses)] = self.impulse
        self._velocities[k % (self.states + 1)] = v
        self._count += 1
        if k < self.states:
            return None
        return smaller(*(v - self._velocities[(k + 1) % (self.states + 1)]))

    def bounds(self) -> tuple[Array, Array]:
        """Return the smallest and largest impulse over the interval, (nv,)."""
        return np.minimum.reduce(self._impulses), np.maximum.reduce(self._impulses)


class MomentumCheck:
    """Compares changes of momentum, M Δv, with the impulse of the efforts.

    In a time w a joint's momentum changes by the integral of tau - h, and by other
    effects: friction, an error of the masses, contacts. They are bounded
    (`LiveSettings.friction`, `LiveSettings.contact`), so a larger residual is a hard
    collision, or position and velocity are wrong in the same way. A joint may follow
    its effort by less, because of a rotor that the model lacks.

    Attributes:
        beyond: Joints whose momentum changes by more, shape (nv,).
        rest: The residual: other efforts on every joint, shape (nv,) [N·m or N].
    """

    def __init__(
        self, robot: Robot, settings: LiveSettings, effort: Array, period: float
    ) -> None:
        """``effort`` limits the efforts, shape (nv,), inf where unlimited."""
        nv, self._period = robot.nv, period
        self._noise = settings.velocity_error
        share = settings.friction + settings.contact
        self._allowed = np.where(np.isfinite(effort), share * effort, np.inf)
        if robot.unactuated:  # the forces at its feet are unknown
            self._allowed[:] = np.inf
        lag = max(ceil(_LAG / period), 1)
        self._windows = [
            _Window(max(ceil(w / period), _FEW), lag, nv) for w in (_JUMP, _PUSH)
        ]
        self._few = np.zeros((2, _FEW, nv))
        self._none = np.zeros(nv, dtype=bool)
        self.restart()

    def restart(self) -> None:
        """Forget all motion."""
        for window in self._windows:
            window.restart()
        self._count = 0
        self._few[:] = 0.0
        self.beyond: Flags = self._none
        self.rest: Array = np.zeros(self._none.size)

    def update(self, now: Array, means: Array, driving: Driving, passed: float) -> None:
        """Check a new state.

        Args:
            now: Measured velocity, and slope of the positions since the last state,
                shape (2, nv).
            means: Their means of some milliseconds, shape (2, nv).
            driving: The terms that have driven the joints since the last state.
            passed: Time since then [s].
        """
        if passed > _GAP * self._period:
            for window in self._windows:
                window.restart()
            self._count, self.beyond = 0, self._none
            return
        self._few[:, self._count % _FEW] = now
        self._count += 1
        self.beyond = self._none
        both = self._few.mean(axis=1), means
        for window, speeds in zip(self._windows, both, strict=True):
            change = window.add(speeds, passed * driving.effort)
            if change is not None and self._count > window.states + _FEW:
                self._judge(window, change, driving)

    def _judge(self, window: _Window, change: Array, driving: Driving) -> None:
        width = window.states * self._period
        momentum = driving.inertia @ change
        allowed = (self._allowed + _GRAVITY * np.abs(driving.gravity)) * width
        allowed += self._noise * np.diag(driving.inertia)
        if (np.abs(momentum - window.impulse) <= allowed).all():
            return  # the usual case
        least, most = window.bounds()
        allowed += _MASSES * np.maximum(np.abs(least), np.abs(most))
        # A moving joint may be heavier than its model, and its momentum smaller.
        moves = np.abs(change) > self._noise
        least = np.where(moves, np.minimum(least, 0.0), least)
        most = np.where(moves, np.maximum(most, 0.0), most)
        rest = np.maximum(momentum - most, least - momentum)
        beyond = rest > allowed
        sign = np.where(momentum > most, 1.0, -1.0)
        self.rest = np.where(beyond & ~self.beyond, sign * rest / width, self.rest)
        self.beyond = self.beyond | beyond
