"""Orientations one after the other, by the shortest turns."""

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
    """R(t) = exp(s a_i) R_i between times t_i and t_{i+1}, s the `smooth_step`.

    a_i = R_i log(R_iᵀ R_{i+1}) is the shortest turn to the next waypoint, in the world
    frame (half a turn can go either way round: put a waypoint between). The body comes
    to rest at each waypoint; the motion is C², and holds before and after.

    Attributes:
        rotations: R_i, shape (m, 3, 3).
        times: t_i, increasing, shape (m,) [s].
    """

    __slots__ = ("_turns", "rotations", "times")

    def __init__(
        self, rotations: ArrayLike | Sequence[ArrayLike], times: ArrayLike
    ) -> None:
        """Pass through ``rotations`` at ``times``.

        Args:
            rotations: At least two rotation matrices, shape (m, 3, 3).
            times: When to be there, increasing, shape (m,) [s].
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
        turn(rotations[i + 1], turns[i], 0.0, rotation)  # not a bit away from it
    for k in range(3):
        velocity[k] = s_dot * turns[i, k]
        acceleration[k] = s_ddot * turns[i, k]
