"""A payload that the controller does not know."""

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import SimulationError
from hsp_control.declaration import within
from hsp_control.declaration.quantities import NonNegative, Positive, Vector3
from hsp_control.robot import Robot
from hsp_control.simulation.plants.model_changes.model_change import ModelChange


class Payload(ModelChange):
    """A solid ball at a frame, which the controller does not know about."""

    frame: str
    """Name of the frame that the payload is fixed to [-]."""
    mass: Positive
    """Mass of the payload [kg]."""
    center: Vector3 = (0.0, 0.0, 0.0)
    """Centre of the ball in the frame [m]."""
    radius: NonNegative = 0.0
    """Radius of the ball [m]; 0 is a point mass."""

    def apply(self, model: pin.Model, robot: Robot, seed: int) -> None:
        """Add the ball to the body of the frame.

        Raises:
            FrameNotFoundError: If there is no such frame.
            SimulationError: If the frame is fixed to the world.
        """
        with within("frame"):
            frame = robot.model.frames[robot.frame_id(self.frame)]
            if frame.parentJoint == 0:
                raise SimulationError(f"{self.frame!r} is fixed to the world")
        center = frame.placement.act(np.asarray(self.center))
        inertia = 0.4 * self.mass * self.radius**2 * np.eye(3)
        model.inertias[frame.parentJoint] += pin.Inertia(self.mass, center, inertia)
