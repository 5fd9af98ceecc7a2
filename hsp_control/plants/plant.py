"""What a plant is: the world's answer to an effort."""

from typing import Protocol

from hsp_control.arrays import Array
from hsp_control.robot import Robot


class Plant(Protocol):
    """A robot as the world has it, which need not be the controller's model.

    Attributes:
        robot: The robot that moves.
    """

    robot: Robot

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v' at time t [s], shape (nv,), for an effort of shape (nv,)."""
        ...
