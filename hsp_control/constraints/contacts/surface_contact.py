"""A flat sole: six rows, and a force at every corner."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.robot import Robot
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample


class SurfaceContact(Contact):
    """A flat part of a link rests on the plane.

    Forces act at its corners, so that the centre of pressure stays within the sole and
    the yaw moment is limited by friction. Separate limits on the centre of pressure and
    on the yaw moment let feet slide by centimetres.

    Attributes:
        points: The corners in the frame, shape (k, 3) [m].
    """

    rows = 6

    def __init__(
        self,
        robot: Robot,
        frame: str,
        *,
        corners: Sequence[Sequence[float]] | Array,
        **options: Any,
    ) -> None:
        """Create the contact.

        Args:
            robot: The robot.
            frame: Name of the frame.
            corners: At least three points of the sole, in the frame, shape (k, 3) [m].
            options: The arguments that all contacts have: see `Contact`.

        Raises:
            FrameNotFoundError: If the robot has no such frame.
            ContactError: If the corners span no surface, or an argument is out of its
                range.
        """
        points = np.array(corners, dtype=float)
        flat = (
            points.ndim == 2 and points.shape[1:] == (3,) and np.isfinite(points).all()
        )
        spread = points - points.mean(axis=0) if flat and len(points) >= 3 else None
        if spread is None or np.linalg.matrix_rank(spread, tol=1e-6) < 2:
            raise ContactError(
                f"contact at {frame!r}: corners {corners!r} span no surface; needs "
                "three points or more, not on one line"
            )
        super().__init__(robot, frame, points, **options)

    @classmethod
    def rectangle(
        cls,
        robot: Robot,
        frame: str,
        *,
        length: float,
        width: float,
        center: Sequence[float] = (0.0, 0.0, 0.0),
        **options: Any,
    ) -> "SurfaceContact":
        """Return a rectangular sole.

        Args:
            robot: The robot.
            frame: Name of the frame.
            length: Length along the frame's x axis [m].
            width: Width along the frame's y axis [m].
            center: Centre of the rectangle in the frame [m].
            options: The arguments that all contacts have: see `Contact`.
        """
        x, y = 0.5 * length, 0.5 * width
        square = np.array([[x, y, 0.0], [x, -y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        return cls(robot, frame, corners=square + np.array(center), **options)

    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write the six rows of the frame: it neither moves nor turns."""
        out.jacobian[:] = frame.jacobian
        out.jacobian_dot[:] = frame.jacobian_dot

    def arms(self, frame: FrameKinematics) -> Array:
        """Return the corners, from the frame's origin, in world axes, shape (k, 3)."""
        return self.points @ frame.rotation.T
