"""The momentum observer of De Luca: an estimate of disturbance efforts.

A. De Luca, R. Mattone, "Actuator failure detection and isolation using generalized
momenta", ICRA 2003. With p = M v, p' = tau + Cᵀv - G + d for a disturbance d, and

    r' = K_O (d - r)

is a low-pass of d. It needs no measured acceleration.
"""

from math import exp
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.checks import (
    check_fixed_base,
    per_dof,
    positive,
)
from hsp_control.robot import Robot, RobotState


class MomentumObserver:
    """Estimates the disturbance r: the efforts that the model does not explain.

    Over a period h with a constant effort, the mean of d is
    Δp/h - tau - (mean of Cᵀv - G), to second order in h. r moves towards it by the part
    1 - exp(-K_O h), the exact step of the filter, so the observer by itself is stable
    for every K_O h.

    The cancelled part of r is clipped. Otherwise the robot would resist a person who
    holds it, or a collision, with its full effort.

    Attributes:
        bandwidth: K_O [1/s].
        clip: Maximum |r| that is cancelled, a number or shape (nv,) [N·m or N].
        disturbance: r, shape (nv,) [N·m or N], since `restart`.
        cancelled: r, clipped, shape (nv,) [N·m or N].
    """

    def __init__(self, bandwidth: float = 50.0, clip: Any = np.inf) -> None:
        """Set the observer.

        Args:
            bandwidth: K_O > 0 [1/s]; 20 to 50 is usual.
            clip: Maximum |r| that is cancelled, a number or shape (nv,) [N·m or N].

        Raises:
            CompensationError: If the bandwidth is not positive.
        """
        self.bandwidth = positive(bandwidth, "bandwidth")
        self.clip = clip

    def check(self, robot: Robot) -> None:
        """Check that the observer fits the robot.

        Raises:
            CompensationError: If the robot has a free-flyer root, or the clip is not
                positive, or has another shape.
        """
        check_fixed_base(robot, "momentum_observer")
        per_dof(robot, self.clip, "clip")

    def restart(self, robot: Robot) -> None:
        """Set the estimate to zero."""
        self.disturbance: Array = np.zeros(robot.nv)
        self.cancelled: Array = np.zeros(robot.nv)
        self._clip = per_dof(robot, self.clip, "clip")
        self._momentum: Array | None = None
        self._drift: Array = np.zeros(robot.nv)

    def update(self, state: RobotState, tau: Array, period: float) -> Array:
        """Update the estimate with a measurement, and return it.

        Args:
            state: The state as measured now.
            tau: The effort that acted on the model since the last measurement, shape
                (nv,): without the friction feed-forward, which friction has taken.
            period: Time since the last measurement [s].

        Returns:
            r, shape (nv,), overwritten by the next call.
        """
        momentum, drift = state.mass_matrix @ state.v, _drift(state)
        if self._momentum is not None:
            mean = 0.5 * (drift + self._drift)
            disturbance = (momentum - self._momentum) / period - tau - mean
            share = 1.0 - exp(-self.bandwidth * period)
            self.disturbance += share * (disturbance - self.disturbance)
            np.clip(self.disturbance, -self._clip, self._clip, out=self.cancelled)
        self._momentum, self._drift = momentum, drift
        return self.disturbance


def _drift(state: RobotState) -> Array:
    """Return Cᵀv - G = M'v - N, since M' = C + Cᵀ and N = C v + G."""
    return state.mass_matrix_rate @ state.v - state.nonlinear_effects
