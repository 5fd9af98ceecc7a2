"""An elastic joint: a motor that moves a link through a spring.

M. W. Spong, "Modeling and control of elastic joint robots", J. Dyn. Sys. Meas. Control
109 (1987), for one joint. With the inertias relative to the one that the model has,

    λ x'' = κ (θ - x) + δ (θ' - x'),     μ θ'' = u - κ (θ - x) - δ (θ' - x').
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.linalg import expm

from hsp_control.common.arrays import Array


@dataclass(frozen=True)
class ElasticJoint:
    """An elastic joint whose model is rigid."""

    link: float  # λ, the link's inertia over that of the model [-]
    # μ, the motor's inertia over that of the model [-]; a model that is right but for
    # the spring has λ + μ = 1
    motor: float
    stiffness: float  # κ, the spring's stiffness over the model's inertia [1/s²]
    damping: float = 0.0  # δ, its damping over the model's inertia [1/s]
    # where position and velocity are measured
    measured: Literal["motor", "link"] = "motor"

    def transition(self, period: float) -> tuple[Array, Array]:
        """Return Φ, shape (4, 4), and Γ, shape (4,), of (x, x', θ, θ') over a period.

        The acceleration u is held: the state becomes Φ s + Γ u.
        """
        spring = np.array(
            [-self.stiffness, -self.damping, self.stiffness, self.damping]
        )
        rates = np.zeros((5, 5))
        rates[0, 1] = rates[2, 3] = 1.0
        rates[1, :4], rates[3, :4] = spring / self.link, -spring / self.motor
        rates[3, 4] = 1.0 / self.motor
        after = expm(rates * period)
        return after[:4, :4], after[:4, 4]
