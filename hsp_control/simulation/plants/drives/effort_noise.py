"""Motors whose torque ripples."""

from dataclasses import dataclass
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.chance import generator
from hsp_control.simulation.plants.drives.drive import Drive


@dataclass
class EffortNoise(Drive):
    """Gaussian white noise, constant over a period.

    Attributes:
        std: Standard deviation [N·m or N], for all joints or of shape (nv,).
        seed: Of the random numbers.
    """

    std: Any
    seed: int = 0

    def reset(self, robot: Robot) -> None:
        """Begin the random numbers anew; see `Drive.reset`."""
        self._rng = generator(self)
        self._std = per_dof(robot, self.std, "effort noise")

    def apply(self, tau: Array) -> Array:
        """Add the noise."""
        return tau + self._std * self._rng.standard_normal(self._std.shape)
