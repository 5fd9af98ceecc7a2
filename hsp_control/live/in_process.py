"""A simulated robot in the loop's own process, not in real time: for dry runs."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.live.hardware import Measurement
from hsp_control.live.simulated_robot import SimulatedRobot


class InProcessRobot:
    """A `SimulatedRobot` as `Hardware`: each `read` simulates the next period.

    Before the first effort, reads return the robot waiting at its start. A run is not
    in real time and has no deadline misses; it equals `simulate` with the same plant
    and period.

    Attributes:
        robot: The robot.
        period: Length of a period [s].
        closed: Whether `close` was called.
    """

    def __init__(self, robot: SimulatedRobot) -> None:
        """Connect to the robot."""
        self.robot = robot
        self.period = robot.period
        self._sequence = 0
        self._efforts: list[Array] = []
        self.closed = False

    def read(self, timeout: float) -> Measurement:
        """Simulate a period, and return the state at its end, at once."""
        self.robot.advance(self._efforts)
        self._efforts = []
        self._sequence += 1
        return self.robot.measured()._replace(sequence=self._sequence)

    def write(self, effort: Array) -> None:
        """Set the effort of the next period, shape (nv,)."""
        self._efforts.append(np.array(effort))

    def close(self) -> None:
        """Stop the robot, and simulate it until it has stopped."""
        if not self.closed:
            self.closed = True
            self.robot.halt("the loop has ended")
            while not self.robot.done:
                self.robot.advance([])
