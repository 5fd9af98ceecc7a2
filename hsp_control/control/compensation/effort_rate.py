"""A limit on the effort rate, for drives that accept no faster change."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import CompensationError
from hsp_control.constraints.limits.numbers_by_joint import by_dof
from hsp_control.robot import Robot


class EffortRateClip:
    """Clips each effort to within rate · period of the last one, in one run.

    For robots without `Limits`. Prefer `Limits`, whose QP keeps the rate by deviating
    in the null space first; clipping disturbs the tasks as well.
    """

    def __init__(self, robot: Robot, rate: Any) -> None:
        """Set the maximum rate. The first effort is not clipped.

        Args:
            robot: The robot.
            rate: One number or nv numbers [N·m/s or N/s]; None for no limit.

        Raises:
            CompensationError: If there are neither one nor nv numbers.
        """
        self._rate = by_dof(rate, robot.nv, error=CompensationError)
        self._last: Array | None = None

    def apply(self, tau: Array, period: float) -> bool:
        """Clip an effort in place.

        Args:
            tau: Effort, shape (nv,) [N·m or N].
            period: Time since the last effort [s].

        Returns:
            Whether the effort was changed.
        """
        clipped = False
        if self._last is None:
            self._last = tau.copy()
        else:
            step = self._rate * period
            permitted = self._last.copy()
            np.clip(tau, self._last - step, self._last + step, out=permitted)
            clipped = not np.array_equal(permitted, tau)
            tau[:] = self._last[:] = permitted
        return clipped
