"""Velocity by differences, for a robot that measures only positions."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import joint_dofs
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class DifferencedVelocity(Sensor):
    """The difference of the last two measured positions, over the time between them.

    Its delay is half a period, and its resolution is one encoder count per period. At
    the first measurement, and for a root, the velocity is passed on unchanged.
    """

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Clear the last position; see `Sensor.reset`."""
        self._robot, self._joints = robot, joint_dofs(robot)
        self._last: tuple[float, Array] | None = None

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Replace the joints' velocities; see `Sensor.measure`."""
        if self._last is not None and t > self._last[0]:
            rate = self._robot.difference(self._last[1], q) / (t - self._last[0])
            v = np.where(self._joints, rate, v)
        self._last = (t, q.copy())
        return q, v
