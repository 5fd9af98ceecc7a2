"""A smooth transition from a given point into a moving trajectory."""

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

    It is C² from t0 on: it starts at x0 with velocity v0 and zero acceleration, and
    equals x_d from t0 + T on. Before t0 it rests at x0.

    Attributes:
        start: x0, shape (n,).
        trajectory: x_d.
        duration: T [s].
        start_velocity: v0, shape (n,) [1/s].
        start_time: t0 [s].
    """

    __slots__ = (
        "_start_state",
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
        """Set the transition from ``start`` into ``trajectory``.

        Args:
            start: x0, shape (n,).
            trajectory: x_d, of dimension n.
            duration: T > 0 [s].
            start_velocity: v0, shape (n,) [1/s]; zero by default.
            start_time: t0 [s].

        Raises:
            TrajectoryError: If a shape does not fit the trajectory, a value is not
                finite, or the duration is not positive.
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
        self._start_state = np.stack([self.start, self.start_velocity])

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
            _blend(self.start_time, self.duration, self._start_state, *out, float(t))
        return out

    def follow(self, out: TrajectorySample) -> Follower:
        """Return the follower; see `Trajectory.follow`."""
        start, end = self.start_time, self.start_time + self.duration
        blend = bind(_blend, start, self.duration, self._start_state, *out, timed=True)
        return follow_blended(self.trajectory, out, blend, start, end)


@kernel
def _blend(
    start_time: float,
    duration: float,
    start_state: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    """Blend the sample of x_d with the line x0 + (t - t0) v0, in place.

    The rows of ``start_state`` are x0 and v0.
    """
    elapsed = t - start_time
    if elapsed < 0.0:
        for i in range(position.size):
            position[i], velocity[i], acceleration[i] = start_state[0, i], 0.0, 0.0
        return
    if elapsed >= duration:
        return
    s, s_dot, s_ddot = smooth_step(elapsed, 0.0, duration)
    for i in range(position.size):
        x, v = start_state[0, i] + elapsed * start_state[1, i], start_state[1, i]
        gap, gap_dot = position[i] - x, velocity[i] - v
        position[i] = x + s * gap
        velocity[i] = v + s_dot * gap + s * gap_dot
        acceleration[i] = s_ddot * gap + 2.0 * s_dot * gap_dot + s * acceleration[i]
