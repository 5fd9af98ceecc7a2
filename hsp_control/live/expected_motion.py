"""The motion expected by the model, for comparison with the sources of a velocity."""

from math import exp

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.common.errors import HspControlError
from hsp_control.engine import Dynamics
from hsp_control.robot import Robot

_BANDWIDTH = 30.0
"""Rate at which an expected velocity follows a source [1/s]."""
_ALONE = 3.0
"""The rate if the other source was wrong: a braked joint must follow its effort
[1/s]."""
_SLOWLY = 10.0
"""Maximum rate of the mean of the sources [1/s]: if neither is trusted only this mean
remains, and before that a wrong source must not displace it far."""
_MEMORY = 0.5
"""Time constant with which surprises decay [s]: that of the sum of small differences,
which may detect a fault that much later."""


class ExpectedMotion:
    """The velocity of a joint expected by the model, from each of its sources.

    The sources are the rows of all arrays: the measured velocity, the slope of the
    positions, and the mean of the trusted ones of these. An expectation is integrated
    with the model under the efforts applied and the load, and follows its source by a
    limited step, so that a jump of a sensor is not followed at once. A second state of
    the first two estimates the acceleration that the model lacks yet. Braked joints
    keep it while both are trusted: the load may come from the wrong one.

    Attributes:
        v: The expected velocities, shape (3, nv) [rad/s or m/s].
        before: Those before the last sources were followed, shape (3, nv).
        surprise: The largest recent differences, shape (3, nv).
        usual: Those before the last one, shape (3, nv).
        acceleration: The acceleration by the applied efforts and the model, without
        the load, shape (nv,).
        loaded: The one with it, shape (nv,).
    """

    def __init__(
        self, robot: Robot, error: float, period: float, dynamics: Dynamics
    ) -> None:
        self._robot, self._error, self._dynamics = robot, error, dynamics
        self._rate = min(_BANDWIDTH, 0.3 / period)
        self._rates = np.array([0.0, _ALONE, self._rate])
        self._most = np.array([[self._rate], [self._rate], [_SLOWLY]])
        self._sources = np.zeros((3, robot.nv))
        self.begin(np.zeros(robot.nv))

    def begin(self, v: Array) -> None:
        """Begin at a velocity, shape (nv,), for all sources."""
        self.v: Array = np.tile(v, (3, 1))
        self.before = self.v
        self.surprise: Array = np.zeros((3, v.size))
        self.usual = self.surprise
        # by the first two sources: what load and model lack, and what the model lacked
        # before the joints were braked
        self._missed: Array = np.zeros((2, v.size))
        self._lacking = self._missed
        self._kept: Flags = np.zeros(v.size, dtype=bool)  # whether that still counts
        self.acceleration: Array = np.zeros(v.size)
        self.loaded = self.acceleration

    def apply(self, q: Array, v: Array, tau: Array, load: Array) -> None:
        """Record the effort and the load that act from now on, (nv,), at a state."""
        if self._robot.unactuated:  # the forces at the feet are unknown
            return
        moved, dynamics = self._robot.forward_dynamics, self._dynamics
        try:
            acceleration = moved(q, v, tau, dynamics)
            loaded = moved(q, v, tau + load, dynamics) if load.any() else acceleration
        except HspControlError:
            return
        if np.isfinite([acceleration, loaded]).all():
            self.acceleration, self.loaded = acceleration, loaded

    def advance(self, passed: float) -> None:
        """Advance by a time [s]."""
        own = np.where(self._kept, self.acceleration + self._lacking, self.loaded)
        own = own + self._missed
        self.v = self.v + passed * np.vstack([own, self.loaded])

    def follow(
        self, measured: Array, trusted: Flags, passed: float, *, braked: bool
    ) -> None:
        """Compare with the sources, and follow them.

        Args:
            measured: The velocity, and the slope of the positions, shape (2, nv).
            trusted: Whether they are trusted, shape (2, nv). A joint without a trusted
                one continues as expected.
            passed: Time since the last ones [s].
            braked: Whether the joints are braked, and must follow their efforts.
        """
        sources, known = self._sources, trusted.sum(axis=0)
        sources[:2] = measured
        sources[2] = (trusted * measured).sum(axis=0) / np.maximum(known, 1)
        if braked:
            known = np.minimum(known, 1)
        difference = sources - self.v
        self.before, self.usual = self.v, exp(-passed / _MEMORY) * self.surprise
        self.surprise = np.maximum(self.usual, np.abs(difference))
        step = np.minimum(np.maximum(difference, -self._error), self._error)
        rates = np.minimum(self._rates[known], self._most)
        self.v = self.v + np.minimum(2.0 * rates * passed, 1.0) * step
        gain = min(self._rate**2 * passed, self._rate)
        self._missed = (self._missed + gain * step[:2]) * (known == 2)
        self._kept = np.asarray(trusted.all(axis=0) & braked)
        if not braked:
            self._lacking = self.loaded - self.acceleration + self._missed

    def begin_again(self, joints: Flags, measured: Array) -> None:
        """Expect joints, shape (nv,), at the velocity of a source, shape (nv,)."""
        self.v = np.where(joints, measured, self.v)

    def leave(self, wrong: Flags, trusted: Flags) -> None:
        """Take back the last step of joints of which a source is wrong, shape (nv,).

        They follow the one that is still trusted, shape (2, nv), or none.
        """
        by_v, by_q, neither = self.before
        kept = np.where(trusted[0], by_v, np.where(trusted[1], by_q, neither))
        self.v[2] = np.where(wrong, kept, self.v[2])
