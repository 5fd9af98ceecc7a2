"""Random errors of the inertial parameters, different for every body."""

from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange
from hsp_control.simulation.plants.random_numbers import seeded_generator


@dataclass(frozen=True)
class RandomInertias(ModelChange):
    """Uniform random errors of each body's mass, centre of mass and inertia.

    The inertias stay physically consistent: the second moments of mass along the
    principal axes change, each by its own factor.

    Attributes:
        mass: Largest relative error of a mass, below 1: 0.2 is ±20 %.
        inertia: Largest relative error of a principal second moment, below 1.
        com: Largest error of a centre of mass along each axis [m].
        seed: Seed of the random numbers.
    """

    mass: float = 0.0
    inertia: float = 0.0
    com: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        """Check that errors are in range, so that inertias stay positive."""
        for name, error in (("mass", self.mass), ("inertia", self.inertia)):
            if not 0.0 <= error < 1.0:
                raise SimulationError(
                    f"random {name} error is {error}; must be in 0..1"
                )
        if not 0.0 <= self.com < np.inf:
            raise SimulationError(
                f"random com error is {self.com}; must not be negative"
            )

    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Change every body that has mass."""
        rng = seeded_generator(self)
        for index in range(1, model.njoints):
            body = model.inertias[index]
            draws = rng.uniform(-1.0, 1.0, 7)
            if body.mass > 0.0:
                factor = 1.0 + self.mass * draws[0]
                model.inertias[index] = pin.Inertia(
                    factor * body.mass,
                    body.lever + self.com * draws[1:4],
                    factor
                    * _scale_moments(body.inertia, 1.0 + self.inertia * draws[4:]),
                )


def _scale_moments(inertia: Array, factors: Array) -> Array:
    """Return the inertia I = tr(S) - S, with its second moments S scaled by factors."""
    moments, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    scaled = axes @ np.diag(factors * np.maximum(moments, 0.0)) @ axes.T
    return np.asarray(np.trace(scaled) * np.eye(3) - scaled)
