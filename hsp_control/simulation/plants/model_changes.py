"""Differences of a simulated robot's model from the controller's."""

from abc import ABC, abstractmethod
from collections.abc import Iterable

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.declaration import Part, within
from hsp_control.declaration.quantities import (
    NonNegative,
    Positive,
    Share,
    Vector3,
    Weights,
)
from hsp_control.robot import Robot
from hsp_control.robot.description.motor_inertia import MOST
from hsp_control.simulation.plants.imperfect_plant import seeded_generator


class ModelChange(Part, ABC, error=SimulationError):
    """A change of masses, centres of mass or inertias; joints and frames are kept."""

    @abstractmethod
    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Change a model in place.

        Args:
            model: A copy of the robot's model.
            robot: The robot.
            seed: Seed of random numbers.

        Raises:
            HspControlError: If the change does not fit the robot.
        """


def changed(robot: Robot, changes: Iterable[ModelChange], seed: int = 0) -> Robot:
    """Return a new robot with all changes applied in order."""
    model = robot.model.copy()
    for change in changes:
        change.apply(model, robot, seed)
    return Robot(model, robot.source, robot.parts)


class Inertias(ModelChange):
    """Differences of the bodies from the controller's model.

    Every body that has mass is scaled and shifted, and then gets its own uniform random
    errors. The inertias stay physically consistent: the second moments of mass along
    the principal axes change by independent random factors.
    """

    mass_factor: Positive = 1.0
    """Factor on every mass [-]; it also scales the rotational inertias."""
    inertia_factor: Positive = 1.0
    """Further factor on every inertia about the centre of mass [-]."""
    com_shift: Vector3 = (0.0, 0.0, 0.0)
    """Displacement of every centre of mass in its joint's frame [m]."""
    random_mass: Share = 0.0
    """Largest relative error of a mass [-], drawn for every body: 0.2 is ±20 %."""
    random_inertia: Share = 0.0
    """Largest relative error of a principal second moment [-], drawn for every body."""
    random_com: NonNegative = 0.0
    """Largest error of a centre of mass along each axis [m], drawn for every body."""

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
        return _inertia(
            self.mass_factor * body.mass,
            body.lever + np.asarray(self.com_shift),
            self.mass_factor * self.inertia_factor * body.inertia,
        )

    def _scattered(self, body: pin.Inertia, draws: Array) -> pin.Inertia:
        """Return a body with random errors, for 7 random numbers in -1..1."""
        factor = 1.0 + self.random_mass * draws[0]
        return _inertia(
            factor * body.mass,
            body.lever + self.random_com * draws[1:4],
            factor
            * _scale_moments(body.inertia, 1.0 + self.random_inertia * draws[4:]),
        )


def _inertia(mass: float, lever: Array, tensor: Array) -> pin.Inertia:
    """Return a body's inertia; the constructor refuses a moment of -1e-20 kg·m²."""
    body = pin.Inertia(mass, lever, np.eye(3))
    body.inertia = tensor
    return body


def _scale_moments(inertia: Array, factors: Array) -> Array:
    """Return the inertia I = tr(S) - S, with its second moments S scaled by factors."""
    moments, axes = np.linalg.eigh(0.5 * np.trace(inertia) * np.eye(3) - inertia)
    scaled = axes @ np.diag(factors * np.maximum(moments, 0.0)) @ axes.T
    return np.asarray(np.trace(scaled) * np.eye(3) - scaled)


class MotorInertia(ModelChange):
    """Inertia that is added to the diagonal of the mass matrix."""

    inertia: Weights
    """Rotor inertia times gear ratio squared [kg·m² or kg], one number or nv."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Add the inertia."""
        inertia = robot.per_dof(self.inertia)
        if inertia.min() < 0.0 or inertia.max() > MOST:
            given = inertia.min() if inertia.min() < 0.0 else inertia.max()
            raise SimulationError(
                f"{given:g} kg m² (or kg); a rotor behind its gear has 0 to {MOST:g}"
            )
        model.armature += inertia


class Payload(ModelChange):
    """A solid ball at a frame, which the controller's model lacks."""

    frame: str
    """Name of the frame to which the payload is fixed [-]."""
    mass: Positive
    """Mass of the payload [kg]."""
    center: Vector3 = (0.0, 0.0, 0.0)
    """Centre of the ball in the frame [m]."""
    radius: NonNegative = 0.0
    """Radius of the ball [m]; 0 is a point mass."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Add the ball to the body of the frame."""
        with within("frame"):
            frame = robot.model.frames[robot.frame_id(self.frame)]
            if frame.parentJoint == 0:
                raise SimulationError(f"{self.frame!r} is fixed to the world")
        center = frame.placement.act(np.asarray(self.center))
        inertia = 0.4 * self.mass * self.radius**2 * np.eye(3)
        model.inertias[frame.parentJoint] += pin.Inertia(self.mass, center, inertia)
