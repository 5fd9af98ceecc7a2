"""What a robot checks by itself: efforts, their rate, and its speed."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import own_limits
from hsp_control.live.settings import LiveSettings
from hsp_control.robot import Robot

_ROUNDING = 1e-6
"""Tolerance of efforts and their rates, relative to the limit."""
_LARGEST_EFFORT = 1e6
"""No motor is stronger [N·m or N]: it holds where there is no limit."""


class EffortCheck:
    """The checks of a robot's own safety controller, with its own model."""

    def __init__(
        self, robot: Robot, settings: LiveSettings, period: float, effort: Array
    ) -> None:
        """Read the limits."""
        self._names = robot.dof_names
        # The controller's limits may be lower, and may grow while it runs.
        upper = np.maximum(effort, settings.effort_limits(robot))
        self._upper = np.minimum(upper * (1.0 + _ROUNDING), _LARGEST_EFFORT)
        self._step = settings.rate_limits(robot) * period
        self._rate = settings.rate_limits(robot)
        self._compensates = settings.compensates_gravity
        speed = own_limits(robot).velocity
        self._speed = speed * (1.0 + settings.velocity_margin)

    def fault(self, effort: Array, before: Array | None, gravity: Array) -> str | None:
        """Return why an effort is not accepted; ``before`` is None under the brakes."""
        if np.shape(effort) != gravity.shape:
            return f"an effort has shape {np.shape(effort)}; needs {gravity.shape}"
        if not np.isfinite(effort).all():
            return f"an effort is not finite: {effort.tolist()}"
        # The sender may have compensated another gravity: one of another load.
        upper = self._upper + (np.abs(gravity) if self._compensates else 0.0)
        i = int((np.abs(effort) - upper).argmax())
        if abs(effort[i]) > upper[i]:
            return (
                f"{self._names[i]} was sent {effort[i]:.6g}; its effort is limited to "
                f"{upper[i]:.6g}"
            )
        if before is None:
            return None
        step = np.abs(effort - before)
        allowed = self._step * (1.0 + _ROUNDING) + _ROUNDING
        i = int((step - allowed).argmax())
        if step[i] > allowed[i]:
            return (
                f"the effort of {self._names[i]} jumped by {step[i]:.6g} in a period; "
                f"{self._step[i]:.6g} are allowed, a rate of {self._rate[i]:.6g}"
            )
        return None

    def too_fast(self, v: Array) -> str | None:
        """Return which joint exceeds its speed limit, or None."""
        i = int((np.abs(v) - self._speed).argmax())
        if abs(v[i]) <= self._speed[i]:
            return None
        return (
            f"{self._names[i]} moves at {v[i]:.6g}; its speed is limited to "
            f"{self._speed[i]:.6g}"
        )
