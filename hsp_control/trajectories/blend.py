"""From where the robot is into a motion that is already under way."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Follower, follow_blended
from hsp_control.trajectories.timing import smooth_step
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class Blend(Trajectory):
    """x(t) = (1 - s) (x0 + (t - t0) v0) + s x_d(t), with s the `smooth_step`.

    It is C²: it starts at x0 with velocity v0 and without acceleration, and is x_d
    itself from t0 + T on. Before t0 it holds x0 at rest.

    Attributes:
        start: x0, shape (n,).
        trajectory: x_d.
        duration: T [s].
        start_velocity: v0, shape (n,) [1/s].
        start_time: t0 [s].
    """

    __slots__ = (
        "_begin",
        "duration",
        "start",
        "start_time",
        "start_velocity",
        "trajectory",
    )

    def __init__(
        self,
        start: ArrayLike,
        trajectory: Trajectory,
        duration: float,
        start_velocity: ArrayLike | None = None,
        start_time: float = 0.0,
    ) -> None:
        """Lead from ``start`` into ``trajectory``.

        Args:
            start: x0, shape (n,).
            trajectory: x_d, of dimension n.
            duration: T > 0 [s].
            start_velocity: v0, shape (n,) [1/s]; rest by default.
            start_time: t0 [s].
        """
        shape = (trajectory.dimension,)
        self.start = checks.array(start, "start", shape)
        self.trajectory = trajectory
        self.duration = checks.positive(duration, "duration")
        self.start_velocity = checks.array(
            np.zeros(shape) if start_velocity is None else start_velocity,
            "start_velocity",
            shape,
        )
        self.start_time = checks.number(start_time, "start_time")
        self._begin = np.stack([self.start, self.start_velocity])

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return len(self.start)

    def sample(self, t: float, out: TrajectorySample | None = None) -> TrajectorySample:
        """Return the point at time t; see `Trajectory.sample`."""
        out = self._output(out)
        if t >= self.start_time:
            self.trajectory.sample(t, out)
        if t < self.start_time + self.duration:
            _blend(self.start_time, self.duration, self._begin, *out, float(t))
        return out

    def follow(self, out: TrajectorySample) -> Follower:
        """Return the follower; see `Trajectory.follow`."""
        start, end = self.start_time, self.start_time + self.duration
        blend = bind(_blend, start, self.duration, self._begin, *out, timed=True)
        return follow_blended(self.trajectory, out, blend, start, end)


@kernel
def _blend(
    start_time: float,
    duration: float,
    begin: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    """Blend the sample of x_d with the straight line of ``begin``, in place."""
    elapsed = t - start_time
    if elapsed < 0.0:
        for i in range(position.size):
            position[i], velocity[i], acceleration[i] = begin[0, i], 0.0, 0.0
        return
    if elapsed >= duration:
        return
    s, s_dot, s_ddot = smooth_step(elapsed, 0.0, duration)
    for i in range(position.size):
        x, v = begin[0, i] + elapsed * begin[1, i], begin[1, i]
        gap, gap_dot = position[i] - x, velocity[i] - v
        position[i] = x + s * gap
        velocity[i] = v + s_dot * gap + s * gap_dot
        acceleration[i] = s_ddot * gap + 2.0 * s_dot * gap_dot + s * acceleration[i]
