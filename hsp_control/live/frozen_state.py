"""States that are new and do not change, while the model moves."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.dead_reckoning import DeadReckoning
from hsp_control.live.hardware import Measurement
from hsp_control.robot import Robot

_MOVED = 1e-3
"""Predicted motion above which an unchanged state is frozen [rad or m]."""


class FrozenState:
    """Compares an unchanged state with the motion predicted by the model.

    New measurements with the same q and v to the last bit are possible for a robot at
    rest. If their velocity is not 0, or their sensor has noise, the model predicts the
    motion of the robot meanwhile under the applied efforts.

    Such a state must not be used: damping an outdated velocity drives the robot
    backwards. A state with v = 0 in all joints is not judged: a robot held by its
    brakes or its friction looks the same.
    """

    def __init__(self, robot: Robot, period: float, tolerated: int) -> None:
        self._robot, self._tolerated = robot, tolerated
        self._reckoning = DeadReckoning(robot, period)
        self._last: Measurement | None = None
        self._same = 0

    def fault(self, measurement: Measurement, applied: Array) -> str | None:
        """Return why a new measurement cannot be the robot's state, or None."""
        last, self._last = self._last, measurement
        if last is None or not (
            np.array_equal(measurement.q, last.q)
            and np.array_equal(measurement.v, last.v)
            and measurement.v.any()
        ):
            self._same = 0
            return None
        if self._same == 0:
            self._reckoning.correct(last.t, last.q, last.v)
        self._same += 1
        self._reckoning.predict(applied)
        if self._same <= self._tolerated:
            return None
        reached = self._reckoning.state.q
        moved = np.abs(self._robot.difference(measurement.q, reached))
        i = int(moved.argmax())
        if moved[i] <= _MOVED:
            return None
        return (
            f"the state is frozen: it was the same {self._same + 1} times, while "
            f"{self._robot.dof_names[i]} moved by {moved[i]:.2g} by the model"
        )
