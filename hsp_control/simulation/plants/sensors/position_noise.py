"""Noise on the measured configuration."""

from dataclasses import dataclass
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.random_numbers import seeded_generator
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class PositionNoise(Sensor):
    """Gaussian white noise on the configuration, in its tangent space.

    Attributes:
        std: Standard deviation [rad or m], for all joints or of shape (nv,).
        seed: Seed of the random numbers.
    """

    std: Any
    seed: int = 0

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Restart the random numbers; see `Sensor.reset`."""
        self._robot, self._rng = robot, seeded_generator(self)
        self._std = per_dof(robot, self.std, "position noise")

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Move the configuration by a random tangent vector; see `Sensor.measure`."""
        noise = self._std * self._rng.standard_normal(self._robot.nv)
        return self._robot.integrate(q, noise), v
