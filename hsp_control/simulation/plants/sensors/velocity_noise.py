"""Noise on the measured velocity."""

from dataclasses import dataclass
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.random_numbers import seeded_generator
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class VelocityNoise(Sensor):
    """Gaussian white noise on the velocity.

    Attributes:
        std: Standard deviation [rad/s or m/s], for all joints or of shape (nv,).
        seed: Seed of the random numbers.
    """

    std: Any
    seed: int = 0

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Restart the random numbers; see `Sensor.reset`."""
        self._rng = seeded_generator(self)
        self._std = per_dof(robot, self.std, "velocity noise")

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Add the noise to the velocity; see `Sensor.measure`."""
        return q, v + self._std * self._rng.standard_normal(self._std.shape)
