"""What else pushes the joints, told from the momentum: De Luca's observer.

A. De Luca, R. Mattone, "Actuator failure detection and isolation using generalized
momenta", ICRA 2003. With p = M v, p' = tau + Cᵀv - G + d for a disturbance d, and

    r' = K_O (d - r)

low-passes it. Nothing of it needs an acceleration.
"""

from math import exp
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.checks import (
    per_dof,
    positive,
    refuse_floating_base,
)
from hsp_control.robot import Robot, RobotState


class MomentumObserver:
    """The disturbance r of the efforts: what the model does not account for.

    Over a period h of a held effort, d's mean is Δp/h - tau - (mean of Cᵀv - G), to
    second order in h; r moves by 1 - exp(-K_O h) of the way to it, the filter's exact
    step: no K_O h makes it unstable by itself.

    What is cancelled is clipped: else the robot would fight the hand that holds it, and
    a collision, with all its strength.

    Attributes:
        bandwidth: K_O [1/s].
        clip: The most that is ever cancelled, a number or shape (nv,) [N·m or N].
    """

    def __init__(self, bandwidth: float = 50.0, clip: Any = np.inf) -> None:
        """Set the observer.

        Args:
            bandwidth: K_O > 0 [1/s]; 20 to 50 is usual.
            clip: Greatest |r| that is cancelled [N·m or N], for all freedoms or each.

        Raises:
            CompensationError: If the bandwidth is not positive.
        """
        self.bandwidth = positive(bandwidth, "bandwidth")
        self.clip = clip

    def check(self, robot: Robot) -> None:
        """Refuse what does not fit the robot.

        Raises:
            CompensationError: If it has a free-flyer root, or the clip does not fit it.
        """
        refuse_floating_base(robot, "momentum_observer")
        per_dof(robot, self.clip, "clip")

    def restart(self, robot: Robot) -> None:
        """Know nothing of a disturbance."""
        self.disturbance: Array = np.zeros(robot.nv)
        self.cancelled: Array = np.zeros(robot.nv)
        self._most = per_dof(robot, self.clip, "clip")
        self._momentum: Array | None = None
        self._drift: Array = np.zeros(robot.nv)

    def update(self, state: RobotState, tau: Array, period: float) -> Array:
        """Return r, shape (nv,), its own buffer.

        Args:
            state: As measured now.
            tau: What acted since the last measurement, as the law means it, shape
                (nv,): without the friction feed-forward, which friction has eaten.
            period: Time since then [s].
        """
        momentum, drift = state.mass_matrix @ state.v, _drift(state)
        if self._momentum is not None:
            mean = 0.5 * (drift + self._drift)
            disturbance = (momentum - self._momentum) / period - tau - mean
            share = 1.0 - exp(-self.bandwidth * period)
            self.disturbance += share * (disturbance - self.disturbance)
            np.clip(self.disturbance, -self._most, self._most, out=self.cancelled)
        self._momentum, self._drift = momentum, drift
        return self.disturbance


def _drift(state: RobotState) -> Array:
    """Return Cᵀv - G = M'v - N, since M' = C + Cᵀ and N = C v + G."""
    return state.mass_matrix_rate @ state.v - state.nonlinear_effects
