"""The kinds of contacts: points, balls, surfaces, and what slides."""

from dataclasses import KW_ONLY
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.compiled.kernels import KernelCall, kernel
from hsp_control.compiled.linalg import multiply_transposed
from hsp_control.constraints.contacts.contact import (
    NORMAL,
    WRENCH,
    Contact,
    damp_velocity,
)
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Points, Positive, Vector3, read_only
from hsp_control.law import TaskSample
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameMotion, copy_rows


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

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel of the velocity rows of the point."""
        return _hold_point, _point_of(self, state)


def _point_of(contact: Contact, state: RobotState) -> tuple[Any, Array, Array]:
    """Return the first arguments of `_point_velocity_rows`."""
    point, shift = np.array(contact.points[0]), np.array(contact.shift)
    return state.frame(contact.frame), point, shift


@kernel
def _hold_point(
    frame: FrameMotion,
    point: Array,
    shift: Array,
    v: Array,
    damping: float,
    out: TaskSample,
) -> None:
    _point_velocity_rows(frame, point, shift, out.jacobian, out.jacobian_dot)
    damp_velocity(v, damping, out)


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

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel of the velocity rows of the material point in contact."""
        return _hold_point, _point_of(self, state)


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

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel of the normal's row, nᵀ times the point's velocity rows."""
        normal = np.ascontiguousarray(self.axes[:, 2])
        rows = np.zeros((2, 3, state.robot.nv))
        return _hold_normal, (*_point_of(self, state), normal, rows)


@kernel
def _hold_normal(
    frame: FrameMotion,
    point: Array,
    shift: Array,
    normal: Array,
    rows: Array,
    v: Array,
    damping: float,
    out: TaskSample,
) -> None:
    _point_velocity_rows(frame, point, shift, rows[0], rows[1])
    multiply_transposed(rows[0], normal, out.jacobian[0])
    multiply_transposed(rows[1], normal, out.jacobian_dot[0])
    damp_velocity(v, damping, out)


def _surface(corners: Array) -> Array:
    """Return corners that span a surface."""
    spread = corners - corners.mean(axis=0)
    if np.linalg.matrix_rank(spread, tol=1e-6) < 2:
        raise ContactError(
            f"{corners.tolist()} span no surface; needs three points or more, not on "
            "one line"
        )
    return corners


class SurfaceContact(Contact, type="surface"):
    """A flat part of a link rests on the plane: it neither moves nor turns.

    Forces act at its corners, so that the centre of pressure stays within the sole and
    the yaw moment is limited by friction. Separate limits on the centre of pressure and
    on the yaw moment let feet slide by centimetres.

    It is a rectangle, given by ``length``, ``width`` and ``center``, or any polygon,
    given by its ``corners``.
    """

    rows: ClassVar[int] = 6

    _: KW_ONLY
    length: Positive | None = None
    """Length of a rectangular sole along the frame's x axis [m]."""
    width: Positive | None = None
    """Width of a rectangular sole along the frame's y axis [m]."""
    center: Vector3 | None = None
    """Centre of a rectangular sole in the frame, shape (3,) [m]; the frame's origin by
    default."""
    corners: Annotated[Points, AfterValidator(_surface)] | None = None
    """Instead: at least three corners of the sole in the frame, shape (k, 3) [m]."""

    def __post_init__(self) -> None:
        sizes = [self.length is not None, self.width is not None]
        moved = self.center is not None and np.any(self.center)
        if self.corners is not None and (any(sizes) or moved):
            raise ContactError(
                "give either length and width (and center) of the sole, or its "
                "corners; not both"
            )
        if self.corners is None and not all(sizes):
            raise ContactError("give length and width of the sole, or its corners")

    @cached_property
    def points(self) -> Array:
        """The corners in the frame, shape (k, 3) [m]."""
        if self.corners is not None:
            return np.asarray(self.corners)
        assert self.length is not None
        assert self.width is not None
        x, y = 0.5 * self.length, 0.5 * self.width
        square = np.array([[x, y, 0.0], [x, -y, 0.0], [-x, y, 0.0], [-x, -y, 0.0]])
        center = np.zeros(3) if self.center is None else np.asarray(self.center)
        return read_only(square + center)

    def kernel(self, state: RobotState) -> KernelCall:
        """Return the kernel of the frame's six rows: it neither moves nor turns."""
        return _hold_surface, (state.frame(self.frame),)


@kernel
def _hold_surface(
    frame: FrameMotion, v: Array, damping: float, out: TaskSample
) -> None:
    copy_rows(frame.jacobian, frame.jacobian_dot, 0, out.jacobian, out.jacobian_dot)
    damp_velocity(v, damping, out)
