"""Encoders with a finite resolution."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Weights
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class Encoder(Sensor, type="encoder_resolution"):
    """Joint positions rounded to counts; a root is exact."""

    stage: ClassVar[float] = 30.0

    resolution: Weights
    """Resolution of the encoders [rad or m], one number or nv: 2π/2¹⁹ for 19 bits per
    revolution; 0 is exact."""

    @property
    def active(self) -> bool:
        """Whether a joint is rounded."""
        return bool(np.any(self.resolution))

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what rounds to the nearest count; see `Sensor.begin`."""
        with within("resolution"):
            given = per_dof(robot, self.resolution)
        rounded = given > 0.0
        count = np.where(rounded, given, 1.0)

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            position = robot.joint_positions(q)
            change = np.round(position / count) * count - position
            return robot.integrate(q, np.where(rounded, change, 0.0)), v

        return sense
