"""A point contact: three rows, and one force."""

from dataclasses import KW_ONLY
from functools import cached_property
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.declaration.quantities import Vector3
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks import TaskSample


class PointContact(Contact, type="point"):
    """A point of a link rests on the plane: it does not move; the link may turn."""

    rows: ClassVar[int] = 3

    _: KW_ONLY
    point: Vector3 = (0.0, 0.0, 0.0)
    """The point in the frame, shape (3,) [m]."""

    @cached_property
    def points(self) -> Array:
        """The point in the frame, shape (1, 3) [m]."""
        return np.asarray(self.point)[None]

    def constrain(self, frame: FrameKinematics, out: TaskSample) -> None:
        """Write the velocity rows of the point."""
        arm = frame.rotation @ self.points[0]
        point_velocity_rows(
            frame.jacobian,
            frame.jacobian_dot,
            arm,
            np.cross(frame.velocity[3:], arm),
            out.jacobian,
            out.jacobian_dot,
        )

    def arms(self, frame: FrameKinematics) -> Array:
        """Return the point, from the frame's origin, in world axes, shape (1, 3)."""
        return self.points @ frame.rotation.T


@kernel
def point_velocity_rows(
    J: Array, J_dot: Array, arm: Array, arm_dot: Array, out: Array, out_dot: Array
) -> None:
    """Write the velocity rows of a point, and their rate, from those of a frame.

    With l and w the frame's linear and angular rows and r the arm: l + w × r, and its
    rate l' + w' × r + w × r'.

    Args:
        J: Frame Jacobian, world axes, linear rows first, shape (6, nv).
        J_dot: Its rate, shape (6, nv).
        arm: r, from the frame's origin to the point, world axes, shape (3,) [m].
        arm_dot: r', shape (3,) [m/s].
        out: The point's rows, shape (3, nv).
        out_dot: Their rate, shape (3, nv).
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
