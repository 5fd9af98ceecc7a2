"""Something in the hand that the controller does not know of."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import SimulationError
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


@dataclass(frozen=True)
class Payload(ModelChange):
    """A solid ball fixed to a frame.

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
        """Refuse what is no body."""
        where = f"payload at {self.frame!r}"
        if not 0.0 < self.mass < np.inf:
            raise SimulationError(f"{where}: mass is {self.mass} kg; must be positive")
        if np.shape(self.center) != (3,) or not np.isfinite(self.center).all():
            raise SimulationError(f"{where}: center is {self.center}; needs 3 numbers")
        if not 0.0 <= self.radius < np.inf:
            raise SimulationError(
                f"{where}: radius is {self.radius} m; must be positive"
            )

    def apply(self, model: pin.Model, robot: Robot) -> None:
        """Add the ball to the body that carries the frame.

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
        turning = 0.4 * self.mass * self.radius**2 * np.eye(3)
        model.inertias[frame.parentJoint] += pin.Inertia(self.mass, center, turning)
