"""A point contact: three rows, and one force."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.declaration.quantities import Vector3
from hsp_control.law import TaskSample
from hsp_control.robot.kinematics import FrameKinematics, FrameMotion


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

    def constrain(
        self, frame: FrameKinematics, out: TaskSample
    ) -> Sequence[Callable[[], object]]:
        """Return the call for the velocity rows of the point."""
        return [point_rows(self, frame, out.jacobian, out.jacobian_dot)]


def point_rows(
    contact: Contact, frame: FrameKinematics, out: Array, out_dot: Array
) -> Callable[[], object]:
    """Return the call that writes J and J' (3, nv) of a contact's first point."""
    point, shift = np.array(contact.points[0]), np.array(contact.shift)
    return bind(_point_velocity_rows, frame.motion, point, shift, out, out_dot)


@kernel
def _point_velocity_rows(
    frame: FrameMotion, point: Array, shift: Array, out: Array, out_dot: Array
) -> None:
    """Write a point's velocity rows (3, nv), and their rate, from those of a frame.

    With l and w the frame's linear and angular rows and the arm r = R p + s, whose
    shift s does not turn: l + w × r, and its rate l' + w' × r + w × r', where
    r' = ω × R p. p is in the frame, s in world axes [m].
    """
    J, J_dot, R, _, velocity = frame
    x = R[0, 0] * point[0] + R[0, 1] * point[1] + R[0, 2] * point[2]
    y = R[1, 0] * point[0] + R[1, 1] * point[1] + R[1, 2] * point[2]
    z = R[2, 0] * point[0] + R[2, 1] * point[1] + R[2, 2] * point[2]
    u = velocity[4] * z - velocity[5] * y
    v = velocity[5] * x - velocity[3] * z
    w = velocity[3] * y - velocity[4] * x
    x, y, z = x + shift[0], y + shift[1], z + shift[2]
    for j in range(J.shape[1]):
        a, b, c = J[3, j], J[4, j], J[5, j]
        d, e, f = J_dot[3, j], J_dot[4, j], J_dot[5, j]
        out[0, j] = J[0, j] + b * z - c * y
        out[1, j] = J[1, j] + c * x - a * z
        out[2, j] = J[2, j] + a * y - b * x
        out_dot[0, j] = J_dot[0, j] + e * z - f * y + b * w - c * v
        out_dot[1, j] = J_dot[1, j] + f * x - d * z + c * u - a * w
        out_dot[2, j] = J_dot[2, j] + d * y - e * x + a * v - b * u
