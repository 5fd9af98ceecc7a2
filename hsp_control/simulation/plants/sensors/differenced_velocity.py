"""Velocity by differences, for a robot that measures only positions."""

from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.per_joint import joint_dofs
from hsp_control.simulation.plants.sensors.sensor import Sensing, Sensor


class DifferencedVelocity(Sensor, type="differenced_velocity"):
    """The difference of the last two measured positions, over the time between them.

    Its delay is half a period, and its resolution is one encoder count per period. At
    the first measurement, and for a root, the velocity is passed on unchanged.
    """

    stage: ClassVar[float] = 40.0

    def begin(
        self, robot: Robot, q: Array, v: Array, random: np.random.Generator
    ) -> Sensing:
        """Return what replaces the joints' velocities; see `Sensor.begin`."""
        joints = joint_dofs(robot)
        last: tuple[float, Array] | None = None

        def sense(t: float, q: Array, v: Array) -> tuple[Array, Array]:
            nonlocal last
            if last is not None and t > last[0]:
                rate = robot.difference(last[1], q) / (t - last[0])
                v = np.where(joints, rate, v)
            last = (t, q.copy())
            return q, v

        return sense
