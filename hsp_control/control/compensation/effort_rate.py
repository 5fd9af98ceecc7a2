"""Efforts that change no faster than a drive accepts."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.checks import per_dof
from hsp_control.robot import Robot


class EffortRateClip:
    """What goes out is cut to within a step of what went out last.

    For robots without `Limits`, whose programme keeps the rate by giving up the null
    space first; this one asks nobody, and the law suffers where it cuts.

    Attributes:
        rate: The greatest rate, a number or shape (nv,) [N·m/s or N/s].
    """

    def __init__(self, rate: Any) -> None:
        """Set the greatest rate, of all freedoms or of each; a Panda's is 1000."""
        self.rate = rate

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot.

        Raises:
            CompensationError: If a rate is not positive, or their count is not nv.
        """
        per_dof(robot, self.rate, "effort_rate")

    def restart(self, robot: Robot) -> None:
        """Let the first effort be any."""
        self._most = per_dof(robot, self.rate, "effort_rate")
        self._last: Array | None = None

    def apply(self, tau: Array, period: float) -> bool:
        """Cut an effort, in place; return whether it was.

        Args:
            tau: Effort, shape (nv,).
            period: Time since the last one [s].
        """
        cut = False
        if self._last is None:
            self._last = tau.copy()
        else:
            step = self._most * period
            wanted = self._last.copy()
            np.clip(tau, self._last - step, self._last + step, out=wanted)
            cut = not np.array_equal(wanted, tau)
            tau[:] = self._last[:] = wanted
        return cut
