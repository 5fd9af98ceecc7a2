"""A ball that rolls without slipping: three rows, one force below its centre."""

from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.constraints.contacts.point_contact import move_rows
from hsp_control.robot import Robot
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample


class BallContact(Contact):
    """A spherical foot rolls on the plane, as the feet of quadrupeds do.

    The material point that touches, at -r n from the centre, does not slip; the next
    moment it is another point. Holding the centre still instead costs the null space
    0.2 rad/s on Solo (theory.md §7).

    Attributes:
        radius: r [m].
    """

    rows = 3

    def __init__(
        self, robot: Robot, frame: str, *, radius: float, **options: Any
    ) -> None:
        """Set the contact.

        Args:
            robot: The robot.
            frame: Name of the frame at the ball's centre.
            radius: Its radius r [m].
            options: What all contacts share: see `Contact`.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            ContactError: If a number makes no sense.
        """
        if not 0.0 < radius < np.inf:
            raise ContactError(
                f"contact at {frame!r}: radius is {radius} m; must be positive"
            )
        super().__init__(robot, frame, np.zeros((1, 3)), **options)
        self.radius = float(radius)
        self._arm = -self.radius * self.axes[:, 2]

    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write the rows of the velocity at the point that touches, -r n."""
        move_rows(
            frame.jacobian,
            frame.jacobian_dot,
            self._arm,
            np.zeros(3),
            out.jacobian,
            out.jacobian_dot,
        )

    def arms(self, frame: FrameKinematics) -> Array:
        """Return the point that touches, from the ball's centre."""
        return self._arm[None]
