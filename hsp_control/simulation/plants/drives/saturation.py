"""Effort limits of the motors."""

from typing import ClassVar, Literal

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import joint_dofs, per_dof
from hsp_control.simulation.plants.drives.drive import Drive, Driving


class Saturation(Drive, type="saturation"):
    """Each joint's effort is clipped at its limit."""

    stage: ClassVar[float] = 50.0

    limit: Literal["model"] | Weights = "model"
    """Maximum effort [N·m or N], one number or nv, 0 for no limit; ``model`` takes it
    from the URDF, where that has one."""

    def begin(self, robot: Robot, random: np.random.Generator) -> Driving:
        """Return what clips the effort; see `Drive.begin`."""
        with within("limit"):
            limit = self._limit(robot)
        limit = np.where(limit > 0.0, limit, np.inf)
        return lambda tau: (np.clip(tau, -limit, limit), 0.0)

    def _limit(self, robot: Robot) -> Array:
        """Return the limits, shape (nv,), with 0 for none."""
        if not isinstance(self.limit, str):
            return per_dof(robot, self.limit)
        own = np.asarray(robot.model.upperEffortLimit, dtype=float)
        given = joint_dofs(robot) & (own > 0.0) & np.isfinite(own)
        if not given.any():
            raise SimulationError(
                f"the URDF of {robot.name} gives no effort limits; state them"
            )
        return np.where(given, own, 0.0)
