"""A ball that rolls without slipping: three rows, and one force below its centre."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.constraints.contacts.point_contact import point_rows
from hsp_control.declaration.quantities import Positive, read_only
from hsp_control.law import TaskSample
from hsp_control.robot.kinematics import FrameKinematics


class BallContact(Contact, type="ball"):
    """A spherical foot that rolls on the plane, like the feet of quadrupeds.

    The material point in contact, at -r n from the centre, does not slip. A moment
    later another point is in contact. Holding the centre still instead adds a
    null-space error of 0.2 rad/s on Solo.
    """

    rows: ClassVar[int] = 3

    _: KW_ONLY
    radius: Positive
    """Radius r of the ball, whose centre is the frame's origin [m]."""

    @cached_property
    def points(self) -> Array:
        """The ball's centre in the frame, zeros of shape (1, 3) [m]."""
        return read_only(np.zeros((1, 3)))

    @property
    def shift(self) -> Array:
        """From the ball's centre to the point in contact: -r n, shape (3,) [m]."""
        return -self.radius * self.axes[:, 2]

    def constrain(
        self, frame: FrameKinematics, out: TaskSample
    ) -> Sequence[Callable[[], object]]:
        """Return the call for the velocity rows of the material point in contact."""
        return [point_rows(self, frame, out.jacobian, out.jacobian_dot)]
