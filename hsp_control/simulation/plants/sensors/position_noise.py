"""Noise on the measured configuration."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class PositionNoise(Sensor, type="position_noise"):
    """Gaussian white noise on the configuration, in its tangent space."""

    stage: ClassVar[float] = 20.0

    std: Weights
    """Standard deviation of position noise [rad or m], one number or nv."""

    @property
    def active(self) -> bool:
        """Whether there is noise."""
        return bool(np.any(self.std))

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what moves q by a random tangent vector; see `Sensor.begin`."""
        with within("std"):
            std = per_dof(robot, self.std)
        return lambda t, q, v: (
            robot.integrate(q, std * random.standard_normal(robot.nv)),
            v,
        )
