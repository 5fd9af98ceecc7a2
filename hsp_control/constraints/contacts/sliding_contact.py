"""A point that moves along a plane while it presses: one row, and one force."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import ClassVar

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.common.linalg import multiply_transposed
from hsp_control.common.native import bind
from hsp_control.constraints.contacts.commanded_force import NORMAL, WRENCH
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.constraints.contacts.point_contact import point_rows
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Positive, Vector3
from hsp_control.law import TaskSample
from hsp_control.robot.kinematics import FrameKinematics


class SlidingContact(Contact, type="sliding"):
    """A point of a link presses on a plane with a commanded force, and moves along it.

    Only the motion along the normal n is a row, nᵀ(J a + J'v) = -Kd nᵀJ v: tasks move
    the point along the plane. If the normal force alone is commanded, the point slides,
    and friction acts against the motion:

        f = f_n (n - μ tanh(‖u‖/u_s) u/‖u‖)

    with u the tangential velocity of the point once the errors of all tasks are zero.
    So the tangential force belongs to the command, and the friction pyramid contains
    the cone instead of being inscribed. If three numbers are commanded, the point
    carries what it presses on along with it, and the tangential force is what that
    weighs.
    """

    rows: ClassVar[int] = 1

    _: KW_ONLY
    point: Vector3 = (0.0, 0.0, 0.0)
    """The point in the frame, shape (3,) [m]."""
    offset: Vector3 = (0.0, 0.0, 0.0)
    """From that point to where the plane is touched, in world axes: -r n for a ball of
    radius r [m]."""
    smoothing: Positive = 0.01
    """Speed u_s at which three quarters of the friction are expected [m/s]."""

    def __post_init__(self) -> None:
        """Check that there is a command, without moments."""
        if self.force is None:
            with within("force"):
                raise ContactError(
                    "it is missing: a sliding contact needs the normal force with "
                    "which it presses, for example {value: 20}"
                )
        if self.force.dimension == WRENCH:
            with within("force"):
                raise ContactError(
                    "it has 6 coordinates; a sliding contact takes 1 (it slides) or 3 "
                    "(it carries what it presses on)"
                )

    @property
    def slides(self) -> bool:
        """Whether the tangential force follows from the motion."""
        return self.force is not None and self.force.dimension == NORMAL

    @property
    def side(self) -> float:
        """The largest tangential force along an axis, per normal force."""
        return self.friction if self.slides else super().side

    @cached_property
    def points(self) -> Array:
        """The point in the frame, shape (1, 3) [m]."""
        return np.asarray(self.point)[None]

    @property
    def shift(self) -> Array:
        """From the point to where the plane is touched, shape (3,) [m]."""
        return np.asarray(self.offset, dtype=float)

    def constrain(
        self, frame: FrameKinematics, out: TaskSample
    ) -> Sequence[Callable[[], object]]:
        """Return the calls for the normal's row: nᵀ times the point's velocity rows."""
        J, J_dot = np.zeros((2, *frame.jacobian[:3].shape))
        n = np.ascontiguousarray(self.axes[:, 2])
        return [
            point_rows(self, frame, J, J_dot),
            bind(multiply_transposed, J, n, out.jacobian[0]),
            bind(multiply_transposed, J_dot, n, out.jacobian_dot[0]),
        ]
