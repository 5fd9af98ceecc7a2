"""The ideal plant: rigid bodies without friction, by the articulated-body algorithm."""

from hsp_control.arrays import Array
from hsp_control.plants.plant import ContinuousPlant


class RigidBodyPlant(ContinuousPlant):
    """v' = M(q)⁻¹(tau - N(q, v)), the model itself."""

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v'; see `ContinuousPlant.acceleration`."""
        return self.robot.forward_dynamics(q, v, tau)
