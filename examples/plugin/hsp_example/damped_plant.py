"""A plant: the robot's own model, with joints that are damped."""

import numpy as np
from numpy.typing import NDArray

from hsp_control.declaration.quantities import NonNegative
from hsp_control.robot import Robot
from hsp_control.robot.integrators import Integrator
from hsp_control.simulation.plants import ContinuousPlant, PlantPart

Array = NDArray[np.float64]


class DampedPlant(ContinuousPlant):
    """M v' + N = tau - d v."""

    def __init__(self, robot: Robot, damping: float) -> None:
        """Set the robot and its damping d [N·m·s/rad or N·s/m]."""
        super().__init__(robot)
        self._damping = damping

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v', shape (nv,)."""
        return self.robot.forward_dynamics(q, v, tau - self._damping * v)


class Damped(PlantPart, type="damped"):
    """The robot's own model, with joints that are damped."""

    damping: NonNegative = 1.0
    """Damping d of all joints [N·m·s/rad or N·s/m]."""

    def engine(self, robot: Robot, integrator: Integrator) -> DampedPlant:
        """Return the plant without sensors and drives."""
        return DampedPlant(robot, self.damping)
