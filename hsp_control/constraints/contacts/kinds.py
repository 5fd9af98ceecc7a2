"""The kinds of contacts: points, balls, surfaces and sliding contacts."""

from dataclasses import KW_ONLY
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import AfterValidator

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ContactError
from hsp_control.constraints.contacts.contact import NORMAL, WRENCH, Contact
from hsp_control.declaration import within
from hsp_control.declaration.quantities import Points, Positive, Vector3, read_only
from hsp_control.engine.plans import PartCall
from hsp_control.robot import RobotState


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

    def call(self, state: RobotState) -> PartCall:
        """Return the call of the velocity rows of the point."""
        return PartCall(engine.HoldPoint, point=_point_of(self, state))


def _point_of(contact: Contact, state: RobotState) -> dict[str, Any]:
    """Return a point of a frame: its position in the frame, and its shift."""
    return {
        "frame": state.frame(contact.frame),
        "position": np.array(contact.points[0]),
        "shift": np.array(contact.shift),
    }


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

    def call(self, state: RobotState) -> PartCall:
        """Return the call of the velocity rows of the material point in contact."""
        return PartCall(engine.HoldPoint, point=_point_of(self, state))


class SlidingContact(Contact, type="sliding"):
    """A point of a link presses on a plane with a commanded force, and moves along it.

    Only the motion along the normal n is a row, nᵀ(J a + J'v) = -Kd nᵀJ v: tasks move
    the point along the plane. If the normal force alone is commanded, the point slides,
    and friction acts against the motion:

        f = f_n (n - μ tanh(‖u‖/u_s) u/‖u‖)

    with u the tangential velocity of the point once the errors of all tasks are zero.
    So the tangential force belongs to the command, and the friction pyramid contains
    the cone instead of being inscribed. If three components are commanded, the point
    carries the object on which it presses, and the tangential force is its weight.
    """

    rows: ClassVar[int] = 1

    _: KW_ONLY
    point: Vector3 = (0.0, 0.0, 0.0)
    """The point in the frame, shape (3,) [m]."""
    offset: Vector3 = (0.0, 0.0, 0.0)
    """From that point to the point of contact, in world axes: -r n for a ball of
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
                    "it has 6 coordinates; a sliding contact needs 1 (it slides) or "
                    "3 (it moves the body that it presses)"
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
        """From the point to the point of contact, shape (3,) [m]."""
        return np.asarray(self.offset, dtype=float)

    def call(self, state: RobotState) -> PartCall:
        """Return the call of the normal's row, nᵀ times the point's velocity rows."""
        normal = np.ascontiguousarray(self.axes[:, 2])
        point = _point_of(self, state)
        return PartCall(engine.HoldNormal, point=point, normal=normal)


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
    """Instead of a rectangle: at least three corners of the sole in the frame, shape
    (k, 3) [m]."""

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

    def call(self, state: RobotState) -> PartCall:
        """Return the call of the frame's six rows: it neither moves nor turns."""
        return PartCall(engine.HoldSurface, frame=state.frame(self.frame))
