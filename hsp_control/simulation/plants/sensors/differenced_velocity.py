"""Velocity of a robot that measures positions alone."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import joint_dofs
from hsp_control.simulation.plants.sensors.sensor import Sensor


@dataclass
class DifferencedVelocity(Sensor):
    """The last two measured positions' difference, over the time between them.

    It is late by half a period, and a count of the encoder becomes a count a period.
    At the first measurement, and of a root, the velocity is the one passed on to it.
    """

    def reset(self, robot: Robot, t: float, q: Array, v: Array) -> None:
        """Forget the last position; see `Sensor.reset`."""
        self._robot, self._joints = robot, joint_dofs(robot)
        self._last: tuple[float, Array] | None = None

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Replace the joints' velocities."""
        if self._last is not None and t > self._last[0]:
            rate = self._robot.difference(self._last[1], q) / (t - self._last[0])
            v = np.where(self._joints, rate, v)
        self._last = (t, q.copy())
        return q, v
