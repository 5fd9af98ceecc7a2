"""Encoders with a finite resolution."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import per_dof
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class Encoder(Sensor):
    """Joint positions rounded to counts; a root or a joint with resolution 0 is exact.

    Attributes:
        resolution: One count [rad or m], for all joints or of shape (nv,): 2π/2¹⁹ for
            19 bits per revolution.
    """

    resolution: Any

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Set the robot; see `Sensor.reset`."""
        self._robot = robot
        count = per_dof(robot, self.resolution, "encoder resolution")
        self._rounded = count > 0.0
        self._count = np.where(self._rounded, count, 1.0)

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Round the positions to the nearest count; see `Sensor.measure`."""
        position = self._robot.joint_positions(q)
        change = np.round(position / self._count) * self._count - position
        return self._robot.integrate(q, np.where(self._rounded, change, 0.0)), v
