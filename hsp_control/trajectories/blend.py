"""A smooth transition from a given point into a moving trajectory."""

from dataclasses import KW_ONLY, replace
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.declaration.quantities import Number, Positive, Vector
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Follower, follow_blended
from hsp_control.trajectories.timing import smooth_step
from hsp_control.trajectories.trajectory import Trajectory, TrajectorySample


class Blend(Trajectory, type="blend"):
    """x(t) = (1 - s) (x0 + (t - t0) v0) + s x_d(t), with s the `smooth_step`.

    It is C² from t0 on: it starts at x0 with velocity v0 and zero acceleration, and
    equals x_d from t0 + T on. Before t0 it rests at x0.
    """

    points = ("start",)

    trajectory: Trajectory
    """x_d."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    start: Vector | None = None
    """x0, shape (n,) [m, or the task's unit]; where the robot starts by default."""
    start_velocity: Vector | None = None
    """v0, shape (n,) [m/s, or the task's unit per s]; zero by default."""
    start_time: Number = 0.0
    """t0 [s]."""

    def __post_init__(self) -> None:
        """Check that all have one dimension."""
        if self.relative:
            return
        shape = (self.trajectory.dimension,)
        checks.array(np.asarray(self.start), "start", shape)
        if self.start_velocity is not None:
            checks.array(self.start_velocity, "start_velocity", shape)

    @property
    def relative(self) -> bool:
        """Whether it, or the trajectory, depends on where the robot starts."""
        return self.trajectory.relative or super().relative

    def anchored(self, start: ArrayLike | None) -> Self:
        """Return both in the world; see `Trajectory.anchored`."""
        inner = self.trajectory.anchored(start)
        if not self.relative:
            return super().anchored(start)
        return super(Blend, replace(self, trajectory=inner)).anchored(start)

    @property
    def dimension(self) -> int:
        """The number n of coordinates."""
        return self.trajectory.dimension

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
        out = self._output(out)
        start, end = self.start_time, self.start_time + self.duration
        blend = bind(_blend, start, self.duration, self._start_state, *out, timed=True)
        return follow_blended(self.trajectory, out, blend, start, end)

    @property
    def _start_state(self) -> Array:
        x = np.asarray(self.start)
        v = np.zeros_like(x) if self.start_velocity is None else self.start_velocity
        return np.stack([x, np.asarray(v)])


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
