"""A robot without a clock of its own, in the loop's own process: for rehearsals."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.hardware import Measurement
from hsp_control.live.watched_robot import WatchedRobot


class InProcessRobot:
    """A `WatchedRobot` as `Hardware`: each `read` is its next period, at once.

    The first few reads show it waiting. A run against it is a rehearsal: no time
    passes, nothing is late, and it equals `simulate` with the same plant and period.

    Attributes:
        robot: The robot.
        period: Length of a period [s].
    """

    def __init__(self, robot: WatchedRobot) -> None:
        """Set the robot."""
        self.robot = robot
        self.period = robot.period
        self._sequence = 0
        self._efforts: list[Array] = []
        self.closed = False

    def read(self, timeout: float) -> Measurement:
        """Let a period pass, and return the state at its end."""
        self.robot.advance(self._efforts)
        self._efforts = []
        self._sequence += 1
        q, v = self.robot.measure()
        return Measurement(self._sequence, self.robot.t, q, v, halted=self.robot.halted)

    def write(self, effort: Array) -> None:
        """Take the effort of the next period, shape (nv,)."""
        self._efforts.append(np.array(effort))

    def close(self) -> None:
        """Have the robot stop, and live until it stands still."""
        if not self.closed:
            self.closed = True
            self.robot.halt("the loop has ended")
            while not self.robot.done:
                self.robot.advance([])
