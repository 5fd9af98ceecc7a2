"""The ideal plant: rigid bodies without friction, by the articulated-body algorithm."""

from hsp_control.arrays import Array
from hsp_control.robot import Robot


class RigidBodyPlant:
    """v' = M(q)⁻¹(tau - N(q, v)), the model itself.

    Attributes:
        robot: The robot that moves.
    """

    def __init__(self, robot: Robot) -> None:
        """Set the robot."""
        self.robot = robot

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v'; see `Plant.acceleration`."""
        return self.robot.forward_dynamics(q, v, tau)
