"""A point that rests: three rows, one force."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.common.kernels import kernel
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.robot import Robot
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample


class PointContact(Contact):
    """A point of a link rests on the plane and may turn about itself.

    Attributes:
        points: The point in the frame, shape (1, 3) [m].
    """

    rows = 3

    def __init__(
        self,
        robot: Robot,
        frame: str,
        *,
        point: Sequence[float] = (0.0, 0.0, 0.0),
        **options: Any,
    ) -> None:
        """Set the contact.

        Args:
            robot: The robot.
            frame: Name of the frame.
            point: The point in the frame [m].
            options: What all contacts share: see `Contact`.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            ContactError: If a number makes no sense.
        """
        place = np.array(point, dtype=float)
        if place.shape != (3,) or not np.isfinite(place).all():
            raise ContactError(f"contact at {frame!r}: point {point!r} is no point")
        super().__init__(robot, frame, place[None], **options)

    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write the rows of the point's velocity."""
        arm = frame.rotation @ self.points[0]
        move_rows(
            frame.jacobian,
            frame.jacobian_dot,
            arm,
            np.cross(frame.velocity[3:], arm),
            out.jacobian,
            out.jacobian_dot,
        )

    def arms(self, frame: FrameKinematics) -> Array:
        """Return the point, from the frame's origin, in world axes."""
        return self.points @ frame.rotation.T


@kernel
def move_rows(
    J: Array, J_dot: Array, arm: Array, arm_dot: Array, out: Array, out_dot: Array
) -> None:
    """Write the velocity rows of a point at ``arm`` from a frame, and their rate.

    l + w × r, whose rate is l' + w' × r + w × r'.
    """
    x, y, z = arm[0], arm[1], arm[2]
    u, v, w = arm_dot[0], arm_dot[1], arm_dot[2]
    for j in range(J.shape[1]):
        a, b, c = J[3, j], J[4, j], J[5, j]
        d, e, f = J_dot[3, j], J_dot[4, j], J_dot[5, j]
        out[0, j] = J[0, j] + b * z - c * y
        out[1, j] = J[1, j] + c * x - a * z
        out[2, j] = J[2, j] + a * y - b * x
        out_dot[0, j] = J_dot[0, j] + e * z - f * y + b * w - c * v
        out_dot[1, j] = J_dot[1, j] + f * x - d * z + c * u - a * w
        out_dot[2, j] = J_dot[2, j] + d * y - e * x + a * v - b * u
