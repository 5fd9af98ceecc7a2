"""Errors of the inertial parameters: the same for every body, and random ones."""

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import NonNegative, Positive, Share, Vector3
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange
from hsp_control.simulation.plants.random_numbers import seeded_generator


class Inertias(ModelChange):
    """Differences of the bodies from the controller's model.

    Every body that has mass is scaled and shifted, and then gets uniform random errors
    of its own. The inertias stay physically consistent: the second moments of mass
    along the principal axes change, each by its own random factor.
    """

    mass_factor: Positive = 1.0
    """Factor on every mass [-]; it also scales the rotational inertias."""
    inertia_factor: Positive = 1.0
    """Further factor on every inertia about the centre of mass [-]."""
    com_shift: Vector3 = (0.0, 0.0, 0.0)
    """Displacement of every centre of mass in its joint's frame [m]."""
    random_mass: Share = 0.0
    """Largest relative error of a mass [-], drawn for each body: 0.2 is ±20 %."""
    random_inertia: Share = 0.0
    """Largest relative error of a principal second moment [-], drawn for each body."""
    random_com: NonNegative = 0.0
    """Largest error of a centre of mass along each axis [m], drawn for each body."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Change every body that has mass."""
        random = seeded_generator(seed, "RandomInertias")
        scatters = self.random_mass or self.random_inertia or self.random_com
        for index in range(1, model.njoints):
            draws = random.uniform(-1.0, 1.0, 7)
            if model.inertias[index].mass > 0.0:
                body = self._scaled(model.inertias[index])
                model.inertias[index] = (
                    self._scattered(body, draws) if scatters else body
                )

    def _scaled(self, body: pin.Inertia) -> pin.Inertia:
        return pin.Inertia(
            self.mass_factor * body.mass,
            body.lever + np.asarray(self.com_shift),
            self.mass_factor * self.inertia_factor * body.inertia,
        )

    def _scattered(self, body: pin.Inertia, draws: Array) -> pin.Inertia:
        """Return a body with random errors, for 7 random numbers in -1..1."""
        factor = 1.0 + self.random_mass * draws[0]
        return pin.Inertia(
            factor * body.mass,
            body.lever + self.random_com * draws[1:4],
            factor
            * _scale_moments(body.inertia, 1.0 + self.random_inertia * draws[4:]),
        )


def _scale_moments(inertia: Array, factors: Array) -> Array:
    """Return the inertia I = tr(S) - S, with its second moments S scaled by factors."""
    moments, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    scaled = axes @ np.diag(factors * np.maximum(moments, 0.0)) @ axes.T
    return np.asarray(np.trace(scaled) * np.eye(3) - scaled)
