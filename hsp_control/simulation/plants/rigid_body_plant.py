"""The ideal plant: rigid bodies without friction, by the articulated-body algorithm."""

from collections.abc import Sequence
from typing import Any

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.robot.acceleration import Acceleration
from hsp_control.simulation.plants.json_data import to_json_data
from hsp_control.simulation.plants.plant import ContinuousPlant
from hsp_control.simulation.plants.push import Push, Pushes


class RigidBodyPlant(ContinuousPlant):
    """v' = M(q)⁻¹(tau + Σ Jᵀ push - N(q, v)), the model itself.

    Attributes:
        pushes: External wrenches.
    """

    def __init__(self, robot: Robot, pushes: Sequence[Push] = ()) -> None:
        """Set the robot and the pushes.

        Raises:
            FrameNotFoundError: If a push's frame does not exist.
        """
        super().__init__(robot)
        self.pushes = Pushes(robot, pushes)

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v'; see `ContinuousPlant.acceleration`."""
        if self.pushes.any_active(t, t):
            tau = tau + self.pushes.effort(t, q)
        return self.robot.forward_dynamics(q, v, tau)

    def bind(self, q: Array, v: Array, tau: Array) -> Acceleration:
        """Return v'; see `ContinuousPlant.bind`."""
        changed = type(self).acceleration is not RigidBodyPlant.acceleration
        pushed = self.pushes.pushes or self.pushes.reachable
        if pushed or changed:  # a subclass has another one
            return super().bind(q, v, tau)
        return self.robot.bind_forward_dynamics(q, v, tau)

    def describe(self) -> dict[str, Any]:
        """Return its pushes."""
        return {"type": "RigidBodyPlant", "pushes": to_json_data(self.pushes.pushes)}
