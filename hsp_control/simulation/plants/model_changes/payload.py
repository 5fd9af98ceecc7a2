"""A payload that the controller does not know."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


@dataclass(frozen=True)
class Payload(ModelChange):
    """A solid sphere fixed to a frame.

    Attributes:
        frame: The frame.
        mass: Its mass [kg].
        center: Its centre in the frame [m], shape (3,).
        radius: Its radius [m]; 0 is a point.
    """

    frame: str
    mass: float
    center: Sequence[float] = (0.0, 0.0, 0.0)
    radius: float = 0.0

    def __post_init__(self) -> None:
        """Check mass, centre and radius."""
        where = f"payload at {self.frame!r}"
        if not 0.0 < self.mass < np.inf:
            raise SimulationError(f"{where}: mass is {self.mass} kg; must be positive")
        if np.shape(self.center) != (3,) or not np.isfinite(self.center).all():
            raise SimulationError(f"{where}: center is {self.center}; needs 3 numbers")
        if not 0.0 <= self.radius < np.inf:
            raise SimulationError(
                f"{where}: radius is {self.radius} m; must not be negative"
            )

    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Add the sphere to the body of the frame.

        Raises:
            FrameNotFoundError: If there is no such frame.
            SimulationError: If the frame is fixed to the world.
        """
        frame = robot.model.frames[robot.frame_id(self.frame)]
        if frame.parentJoint == 0:
            raise SimulationError(
                f"payload at {self.frame!r}: the frame is fixed to the world"
            )
        center = frame.placement.act(np.asarray(self.center, dtype=float))
        inertia = 0.4 * self.mass * self.radius**2 * np.eye(3)
        model.inertias[frame.parentJoint] += pin.Inertia(self.mass, center, inertia)
