"""Noise on the measured velocity."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class VelocityNoise(Sensor, type="velocity_noise"):
    """Gaussian white noise on the velocity."""

    stage: ClassVar[float] = 50.0

    std: Weights
    """Standard deviation of velocity noise [rad/s or m/s], one number or nv."""

    @property
    def active(self) -> bool:
        """Whether there is noise."""
        return bool(np.any(self.std))

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what adds noise to the velocity; see `Sensor.begin`."""
        with within("std"):
            std = per_dof(robot, self.std)
        return lambda t, q, v: (q, v + std * random.standard_normal(std.shape))
