"""A flat sole: six rows, and a force at every corner."""

from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY
from functools import cached_property
from typing import Annotated, ClassVar

import numpy as np
from pydantic import AfterValidator

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError
from hsp_control.common.native import bind
from hsp_control.constraints.contacts.contact import Contact
from hsp_control.declaration.quantities import Points, Positive, Vector3, read_only
from hsp_control.law import TaskSample
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.task import copy_rows


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
        """Check that the sole is given in one way."""
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

    def constrain(
        self, frame: FrameKinematics, out: TaskSample
    ) -> Sequence[Callable[[], object]]:
        """Return the call for the six rows of the frame: it neither moves nor turns."""
        J, J_dot = out.jacobian, out.jacobian_dot
        return [bind(copy_rows, frame.jacobian, frame.jacobian_dot, 0, J, J_dot)]
