"""Shortest rotations between waypoints, with a stop at each of them."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.rotations import compose_back, log3, rotate, turn
from hsp_control.trajectories import checks
from hsp_control.trajectories.following import Compiled, Kernel
from hsp_control.trajectories.orientation import OrientationTrajectory
from hsp_control.trajectories.timing import smooth_step


class OrientationPath(Compiled, OrientationTrajectory):
    """R(t) = exp(s a_i) R_i from t_i to t_{i+1}, s the `smooth_step`.

    a_i = R_i log(R_iᵀ R_{i+1}) is the shortest rotation to the next waypoint, in the
    world frame. For an angle of π its sense is not unique: add a waypoint in between.
    The body rests at each waypoint, before the first and after the last; the motion is
    C².

    Attributes:
        rotations: R_i, body to world, shape (m, 3, 3).
        times: t_i, increasing, shape (m,) [s].
    """

    __slots__ = ("_turns", "rotations", "times")

    def __init__(
        self, rotations: ArrayLike | Sequence[ArrayLike], times: ArrayLike
    ) -> None:
        """Set the waypoints.

        Args:
            rotations: At least two rotation matrices R_i, body to world, shape
                (m, 3, 3).
            times: Times t_i of the waypoints, increasing, shape (m,) [s].

        Raises:
            TrajectoryError: If there are fewer than two waypoints, one is not a
                rotation matrix, a shape does not fit, or the times do not increase.
        """
        R = checks.array(np.asarray(rotations), "rotations", (None, 3, 3))
        for i, rotation in enumerate(R):
            checks.rotation(rotation, f"rotations[{i}]")
        self.rotations = R
        self.times = checks.waypoint_times(times, len(R))
        turns, between = np.zeros((len(R) - 1, 3)), np.zeros((3, 3))
        for i, a in enumerate(turns):
            compose_back(R[i], R[i + 1], between)
            log3(between, a)
            rotate(R[i], a, a)
        self._turns = turns

    def _kernel(self) -> Kernel:
        return _path, (self.times, self.rotations, self._turns)


@kernel
def _path(
    times: Array,
    rotations: Array,
    turns: Array,
    rotation: Array,
    velocity: Array,
    acceleration: Array,
    t: float,
) -> None:
    last = times.size - 1
    i = 0
    while i < last - 1 and t >= times[i + 1]:
        i += 1
    s, s_dot, s_ddot = smooth_step(t, times[i], times[i + 1] - times[i])
    if s < 1.0:
        turn(rotations[i], turns[i], s, rotation)
    else:
        turn(rotations[i + 1], turns[i], 0.0, rotation)  # exactly the waypoint
    for k in range(3):
        velocity[k] = s_dot * turns[i, k]
        acceleration[k] = s_ddot * turns[i, k]
