"""Noise on the applied effort, such as torque ripple."""

from dataclasses import dataclass
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.drives.drive import Drive
from hsp_control.simulation.plants.random_numbers import seeded_generator


@dataclass
class EffortNoise(Drive):
    """Gaussian white noise on the effort, constant during a period.

    Attributes:
        std: Standard deviation [N·m or N], for all joints or of shape (nv,).
        seed: Seed of the random numbers.
    """

    std: Any
    seed: int = 0

    def reset(self, robot: Robot) -> None:
        """Restart the random numbers; see `Drive.reset`."""
        self._rng = seeded_generator(self)
        self._std = per_dof(robot, self.std, "effort noise")

    def apply(self, tau: Array) -> Array:
        """Add the noise to the effort; see `Drive.apply`."""
        return tau + self._std * self._rng.standard_normal(self._std.shape)
