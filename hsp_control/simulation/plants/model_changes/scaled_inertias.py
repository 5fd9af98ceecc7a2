"""The same errors of the inertial parameters for every body."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


@dataclass(frozen=True)
class ScaledInertias(ModelChange):
    """Scaled masses and inertias, and shifted centres of mass, of every body.

    Attributes:
        mass: Factor of every mass; rotational inertias are scaled with it.
        inertia: Further factor of the inertias about the centres of mass.
        com: Shift of every centre of mass in its joint's frame [m], shape (3,).
    """

    mass: float = 1.0
    inertia: float = 1.0
    com: Sequence[float] = (0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        """Check that the factors are positive and the shift is finite."""
        for name, factor in (("mass", self.mass), ("inertia", self.inertia)):
            if not 0.0 < factor < np.inf:
                raise SimulationError(f"{name} factor is {factor}; must be positive")
        if np.shape(self.com) != (3,) or not np.isfinite(self.com).all():
            raise SimulationError(f"com shift is {self.com}; needs 3 numbers")

    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Change every body that has mass."""
        for index in range(1, model.njoints):
            body = model.inertias[index]
            if body.mass > 0.0:
                model.inertias[index] = pin.Inertia(
                    self.mass * body.mass,
                    body.lever + np.asarray(self.com),
                    self.mass * self.inertia * body.inertia,
                )
