"""A ball that rolls without slipping: three rows, and one force below its centre."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.constraints.contacts.point_contact import point_velocity_rows
from hsp_control.robot import Robot
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample


class BallContact(Contact):
    """A spherical foot that rolls on the plane, like the feet of quadrupeds.

    The material point in contact, at -r n from the centre, does not slip. A moment
    later another point is in contact. Holding the centre still instead adds a
    null-space error of 0.2 rad/s on Solo.

    Attributes:
        radius: r [m].
    """

    rows = 3

    def __init__(
        self, robot: Robot, frame: str, *, radius: float, **options: Any
    ) -> None:
        """Create the contact.

        Args:
            robot: The robot.
            frame: Name of the frame at the ball's centre.
            radius: The ball's radius r [m].
            options: The arguments that all contacts have: see `Contact`.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            ContactError: If an argument is out of its range.
        """
        if not 0.0 < radius < np.inf:
            raise ContactError(
                f"contact at {frame!r}: radius is {radius} m; must be positive"
            )
        super().__init__(robot, frame, np.zeros((1, 3)), **options)
        self.radius = float(radius)
        self._arm = -self.radius * self.axes[:, 2]

    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write the velocity rows of the material point in contact, at -r n."""
        point_velocity_rows(
            frame.jacobian,
            frame.jacobian_dot,
            self._arm,
            np.zeros(3),
            out.jacobian,
            out.jacobian_dot,
        )

    def arms(self, frame: FrameKinematics) -> Array:
        """Return the position of the contact point from the ball's centre, (1, 3)."""
        return self._arm[None]
