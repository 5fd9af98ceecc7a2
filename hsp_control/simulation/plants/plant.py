"""What a plant is: the world's answer to an effort."""

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SimulationError
from hsp_control.control.log_channel import LogChannel
from hsp_control.robot import Robot


class Plant:
    """A robot as the world has it, which need not be the controller's model.

    A plant is either a `ContinuousPlant` or a `SampledPlant`.

    Attributes:
        robot: The robot that moves; its joints are those of the controller's model.
    """

    def __init__(self, robot: Robot) -> None:
        """Set the robot that moves."""
        self.robot = robot

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> Mapping[str, LogChannel]:
        """Return what to log of the plant at its true state under an effort, by name.

        Contact forces go by ``plant.contact.<name>.force``.
        """
        return {}

    def describe(self) -> dict[str, Any]:
        """Return its kind and settings as JSON data, for the log."""
        return {"type": type(self).__name__}


class ContinuousPlant(Plant, ABC):
    """A plant without memory: v' is a function of time, state and effort.

    `simulate` integrates it, with the law in the integrator's stages or efforts held.
    """

    @abstractmethod
    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        """Return v' at time t [s], shape (nv,), for an effort of shape (nv,)."""


class SampledPlant(Plant, ABC):
    """A plant with a state of its own, that moves on under an effort that is held.

    That is what an engine with its own integrator, a joint that sticks, a drive with a
    delay and a robot at the end of a cable have in common. A run is one `reset`, then
    for every control period one `measure` and one `advance`.
    """

    @abstractmethod
    def reset(self, t: float, q: Array, v: Array) -> None:
        """Put it at time t [s] into the state q, shape (nq,), and v, shape (nv,).

        Whatever it remembers is forgotten, and its random numbers begin anew: the same
        run can be repeated.
        """

    @abstractmethod
    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        """Move on from t to ``end`` [s] under an effort of shape (nv,).

        Returns:
            The true (q, v) at ``end``, shapes (nq,) and (nv,), in new arrays.
        """

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        """Return what the controller is shown of the true (q, v); here the truth.

        It is called once a control period, in order of time: sensors may remember.
        """
        return q, v


def differing_bodies(plant: Plant, robot: Robot) -> dict[str, Any]:
    """Return the plant's inertias as JSON data, if they are not the model's.

    By joint: ``mass`` [kg], ``com`` [m] and ``inertia`` (xx, xy, xz, yy, yz, zz) about
    it [kg·m²] in the joint's frame, and ``armature`` of each freedom.
    """
    ours, theirs = robot.model, plant.robot.model
    pairs = zip(ours.inertias, theirs.inertias, strict=True)
    same = np.array_equal(ours.armature, theirs.armature)
    if same and all(mine == other for mine, other in pairs):
        return {}
    bodies = {}
    for index in range(1, theirs.njoints):
        body, joint = theirs.inertias[index], theirs.joints[index]
        own = theirs.armature[joint.idx_v : joint.idx_v + joint.nv]
        bodies[str(theirs.names[index])] = {
            "mass": body.mass,
            "com": body.lever.tolist(),
            "inertia": body.inertia[np.triu_indices(3)].tolist(),
            "armature": own.tolist(),
        }
    return {"bodies": bodies}


def check_plant(plant: Plant, robot: Robot) -> None:
    """Refuse a plant whose joints are not those of the controller's robot.

    Raises:
        SimulationError: If their names, order or kinds differ.
    """
    ours, theirs = (
        [(name, j.nq, j.nv) for name, j in r.joints.items()]
        for r in (robot, plant.robot)
    )
    if ours != theirs:
        raise SimulationError(
            f"the plant moves {plant.robot.name} with the joints "
            f"{', '.join(plant.robot.joint_names)}; the controller's {robot.name} has "
            f"{', '.join(robot.joint_names)}: load both with the same root and locks"
        )
