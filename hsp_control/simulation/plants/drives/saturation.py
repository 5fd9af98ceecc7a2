"""Effort limits of the motors."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import joint_dofs, per_dof
from hsp_control.simulation.plants.drives.drive import Drive


@dataclass
class Saturation(Drive):
    """Each joint's effort is clipped at its limit.

    Attributes:
        limit: The largest effort [N·m or N], for all joints or of shape (nv,), 0 for no
            limit; None: the model's effort limits, where it has any.
    """

    limit: Any = None

    def reset(self, robot: Robot) -> None:
        """Set the limits; see `Drive.reset`."""
        if self.limit is None:
            own = np.asarray(robot.model.upperEffortLimit, dtype=float)
            given = joint_dofs(robot) & (own > 0.0) & np.isfinite(own)
            if not given.any():
                raise SimulationError(
                    f"saturation: the URDF of {robot.name} gives no effort limits; "
                    "state them"
                )
            limit = np.where(given, own, 0.0)
        else:
            limit = per_dof(robot, self.limit, "saturation")
        self._limit = np.where(limit > 0.0, limit, np.inf)

    def apply(self, tau: Array) -> Array:
        """Return the clipped effort; see `Drive.apply`."""
        return np.clip(tau, -self._limit, self._limit)
