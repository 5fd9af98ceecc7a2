"""Compares measured velocities with the slope of the measured positions."""

from math import ceil, exp, inf

import numpy as np

from hsp_control.common.arrays import Array, Flags
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_WINDOW = 0.05
"""Maximum age of the motion in a velocity [s]: a delay of 5 ms and a filter of 20 Hz,
whose step response ends after 40 ms."""
_MEAN_TIME, _MEAN_ERROR = 0.012, 0.3
"""Time constant of the mean excess [s], and its tolerance besides noise, relative to
the error of velocities."""
_FEWEST = 3
"""Minimum number of slopes that are compared, for long periods."""
_LAG = 0.015
"""Mean lag of a velocity by this delay and this filter [s]."""
_MEMORY = 0.5
"""Time constant with which small differences are summed [s]."""
_CONSTANT = 0.01
"""Tolerance of positions for other reasons, such as a coarse encoder [rad or m]."""
_DOUBT_LEAK, _DOUBT = 0.9, 1.9
"""Each doubtful velocity adds 1 to a sum that decays by 0.9 per velocity: two in a row
are a fault, or three of five. A single one is not."""
_SLOPE_TIME = 0.008
"""Time over which a joint's slope is computed, if it replaces its velocity [s]."""
_GAP = 3.5
"""Number of periods without a state after which the slope across them is not compared
with the later velocity, which may be different."""
_STILL = 3
"""Number of states with the same position and velocity after which a sensor is dead."""
_NO_CHANGE = 1e-12
"""Change of a position below which it is rounding [rad or m]."""
_STOPS = 50.0
"""Maximum deceleration of a joint by friction [rad/s² or m/s²]."""
_WENT = 0.05
"""Speed above which a joint has moved before it stopped [rad/s or m/s]."""
_TOGETHER = 3
"""Number of moving joints whose friction does not stop them in the same period."""
_ALONE = 0.2
"""The speed above which a joint does not stop at once whose other sensor is wrong
[rad/s or m/s]."""
_STEP = 2e-3
"""Maximum step of an encoder [rad or m], until smaller changes are observed: between
two steps a velocity computed from them is constant, too."""
_COARSEST = 0.01
"""Resolution of the coarsest encoders, a few of whose steps may be summed [rad or
m]."""
_STEPS = 2.5
"""Encoder steps by which a decelerating joint may lag its last velocity."""


class VelocityCheck:
    """Detects joints whose measured velocity contradicts their positions.

    A delayed and filtered velocity is a mean of earlier ones: it is between the least
    and the greatest velocity in a window. A slope of positions is that in the middle of
    its period; at its end it differs by half of the change that the effort makes in the
    period, 0.5 rad/s in 10 ms at 100 rad/s². The velocity may exceed them by
    `LiveSettings.velocity_error`, and its mean of some milliseconds by less. A smaller
    persistent difference is detected by a leaky sum of dq - v h, which stays small
    under noise and lags.

    Position and velocity that are constant to the last bit are those of a dead sensor
    if the joint was fast before: no brake stops it in a period.

    A base without motors is not judged: its motion is an estimate, and jumps.

    Attributes:
        doubtful: Joints whose last velocity is not used yet, shape (nv,).
        contradicted: Joints whose velocity contradicts their positions, shape (nv,).
        dead: Joints whose sensor is dead, shape (nv,).
        unmoved: Joints whose positions did not change by a bit, shape (nv,).
        constant: Whether velocity and position were the same to the last bit in some
        states, shape (2, nv).
        stands: Joints whose trusted readings did not change by a bit, shape (nv,).
        halted: Joints that moved, and whose readings are now constant, shape (nv,).
        before: Speed of joints before their readings became constant, shape (nv,).
        slope: Slope of the last positions, shape (nv,) [rad/s or m/s].
        difference: Between velocity and slope at the last one, shape (nv,).
        mean: Mean velocity in the same time, shape (nv,).
    """

    def __init__(self, robot: Robot, settings: LiveSettings, period: float) -> None:
        self._error, self._period = settings.velocity_error, period
        self._judged = np.ones(robot.nv, dtype=bool)
        self._judged[list(robot.unactuated)] = False
        self._few = max(2, ceil(_SLOPE_TIME / period))
        self._slopes = np.zeros((max(ceil(_WINDOW / period), _FEWEST), robot.nv))
        self._velocities = np.zeros_like(self._slopes)
        # the least and greatest velocity from the middle to the end of each period
        self._ranges = np.zeros((2, *self._slopes.shape))
        # Masks of the last few of them, by the index of the next one.
        size = len(self._slopes)
        self._latest = (np.arange(size)[:, None] - 1 - np.arange(self._few)) % size
        # Noise of this size, six standard deviations, leaves a sum of this size.
        noise = self._error * np.sqrt(0.5 * period * _MEMORY)
        self._allowed = _CONSTANT + float(noise)
        noise = np.sqrt(period / (2.0 * _MEAN_TIME + period))
        self._allowed_mean = self._error * (_MEAN_ERROR + float(noise))
        self.restart()

    def restart(self) -> None:
        """Forget all positions."""
        nv = self._judged.size
        self._count = 0
        self._ranges[:] = 0.0  # before its first state a robot is at rest
        self._sum, self._fastest, self._doubts, self._beyond = np.zeros((4, nv))
        self._still = np.zeros(nv, dtype=np.int64)
        self._same = np.zeros((2, nv), dtype=np.int64)
        self.constant: Flags = np.zeros((2, nv), dtype=bool)
        self._step = np.full(nv, inf)  # the smallest change of a position
        self._last_v, self._speed = np.zeros((2, nv))
        self.before: Array = np.zeros(nv)
        self.slope: Array = np.zeros(nv)
        self.mean: Array = np.zeros(nv)
        self.difference: Array = np.zeros(nv)
        self.doubtful: Flags = np.zeros(nv, dtype=bool)
        self.contradicted: Flags = np.zeros(nv, dtype=bool)
        self._by_q: Flags = np.ones(nv, dtype=bool)  # trusted positions
        self._by_v: Flags = np.ones(nv, dtype=bool)  # trusted velocities
        self._none, self._nothing = np.zeros(nv, dtype=bool), np.zeros(nv)
        self.dead: Flags = self._none
        self.unmoved: Flags = self._none
        self.stands: Flags = self._none
        self.halted: Flags = self._none

    def trust(self, positions: Flags, velocities: Flags) -> None:
        """Set the trusted sources, shapes (nv,); one with constant values is dead."""
        self._by_q, self._by_v = positions.copy(), velocities.copy()

    def update(
        self, way: Array, v: Array, passed: float, acceleration: Array | float = 0.0
    ) -> None:
        """Check a new measurement.

        Args:
            way: Displacement since the last one, shape (nv,) [rad or m].
            v: Measured velocity, shape (nv,).
            passed: Time since the last one [s].
            acceleration: The one that the model expects meanwhile, shape (nv,).
        """
        slope = way / passed
        at_end = slope + 0.5 * passed * acceleration
        self.difference = np.abs(v - slope)
        k = self._count % len(self._slopes)
        self._slopes[k], self._velocities[k] = slope, v
        self._ranges[:, k] = np.minimum(slope, at_end), np.maximum(slope, at_end)
        self._count += 1
        lower, upper = self._ranges
        few, end = min(self._count, self._few), self._count % len(self._slopes)
        latest = self._latest[end] if few == self._few else slice(0, few)
        self.slope = np.add.reduce(self._slopes[latest]) / few
        self.mean = np.add.reduce(self._velocities[latest]) / few
        least, most = np.minimum.reduce(lower), np.maximum.reduce(upper)
        beyond = v - np.minimum(np.maximum(v, least), most)
        unexplained = way - passed * v
        if passed > _GAP * self._period:
            beyond, unexplained = self._nothing, self._nothing
        self.doubtful = (np.abs(beyond) > self._error) & self._judged
        self._beyond += min(passed / _MEAN_TIME, 1.0) * (beyond - self._beyond)
        self._doubts = _DOUBT_LEAK * self._doubts + self.doubtful
        leak = exp(-passed / _MEMORY)
        self._sum = leak * self._sum + unexplained
        self._fastest = np.maximum(leak * self._fastest, np.abs(v))
        differs = np.abs(self._sum) > self._allowed + 2.0 * _LAG * self._fastest
        differs |= np.abs(self._beyond) > self._allowed_mean
        self.contradicted = (differs | (self._doubts >= _DOUBT)) & self._judged
        self._find_dead(way, v, slope)

    def _find_dead(self, way: Array, v: Array, slope: Array) -> None:
        size = np.abs(way)
        self.unmoved = size < _NO_CHANGE
        self._same = (self._same + 1) * np.stack([v == self._last_v, self.unmoved])
        self.constant = self._same >= _STILL
        self._step = np.where(
            size > _NO_CHANGE, np.minimum(size, self._step), self._step
        )
        still = self.unmoved | ~self._by_q
        still &= (v == self._last_v) | ~self._by_v
        still &= self._by_q | self._by_v
        self.stands = still
        self._last_v = v
        # The speed before it stopped, of two states: the last may be partly wrong.
        # A measured speed, so that friction unknown to the model has no effect.
        now = np.minimum(
            np.where(self._by_v, np.abs(v), inf),
            np.where(self._by_q, np.abs(slope), inf),
        )
        now = np.where(self._by_v | self._by_q, now, 0.0)  # unknown without either
        speed, self._speed = np.maximum(now, self._speed), now
        if not still.any():
            self._still[:], self.before, self.dead = 0, speed, self._none
            self.halted = self._none
            return
        self.before = np.where(still, self.before, speed)
        self._still = np.where(still, self._still + 1, 0)
        lasted = self._still * self._period
        step = np.maximum(_STEP, np.minimum(_STEPS * self._step, _COARSEST))
        far = self.before * lasted > step
        # No encoder is constant at a speed reported for so long.
        frozen = (self._still >= _STILL) & (np.abs(v) > _WENT)
        frozen &= (np.abs(v) * lasted > step) & self._by_q & self._by_v
        self.contradicted = self.contradicted | (frozen & self._judged)
        # Friction may stop one joint soon, but not several in the same period.
        went = still & (self.before > _WENT)
        self.halted = went
        together = (went[:, None] & (self._still[:, None] == self._still)).sum(axis=0)
        fast = self.before > 2.0 * _STOPS * self._period / np.maximum(together, 1)
        fast |= together >= _TOGETHER
        # Where one sensor was wrong, the other one is more likely dead than the joint.
        fast |= (self._by_q ^ self._by_v) & (self.before > _ALONE)
        self.dead = (self._still >= _STILL) & fast & far & self._judged
