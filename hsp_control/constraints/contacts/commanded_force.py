"""The force with which a contact is to press."""

from dataclasses import KW_ONLY
from typing import Annotated

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ContactError, TrajectoryError
from hsp_control.declaration import Part, within
from hsp_control.declaration.nested import parts_within
from hsp_control.declaration.quantities import ArrayField, Number, read_only
from hsp_control.trajectories import Hold, Trajectory
from hsp_control.trajectories.streams.stream import Streamed

NORMAL, FORCE, WRENCH = 1, 3, 6
"""What is commanded, by the number of coordinates."""


class CommandedForce(Part, error=ContactError):
    """A force that the world is to exert on the robot at a contact, in time.

    It is given in the axes of the contact: two tangents and the normal, so that a
    positive normal force presses. One number is the normal force alone, three are the
    force; six are force and moment about the middle of a surface. Points share it: the
    forces of least norm that have this sum, so that the middle is the centre of
    pressure if no moment is commanded.

    The command is the reference of the contact forces in every step, see
    `ActiveStack.support`: what it asks of the base the other contacts balance.
    """

    value: Annotated[ArrayLike, ArrayField(Number | list[Number], read_only)] | None = (
        None
    )
    """A constant command: the normal force, a number [N]; or shape (3,) [N], or
    (6,) [N, N·m]."""
    _: KW_ONLY
    trajectory: Trajectory | None = None
    """Instead: the command in time, of dimension 1, 3 or 6 [N, N·m]."""

    def __post_init__(self) -> None:
        if (self.value is None) == (self.trajectory is None):
            raise ContactError("give either the value of the force or its trajectory")
        if self.trajectory is None:
            self._check_dimension("value", np.size(np.asarray(self.value)))
            return
        with within("trajectory"):
            if any(True for _ in parts_within(self.trajectory, Streamed)):
                raise ContactError(
                    "a stream cannot command a force; while the controller runs, "
                    "controller.at(t).force(contact, force) does"
                )
            try:
                self.trajectory.anchored(None)
            except TrajectoryError as error:
                raise ContactError(str(error)) from None
        self._check_dimension("trajectory", self.trajectory.dimension)

    @property
    def dimension(self) -> int:
        """The number of coordinates: `NORMAL`, `FORCE` or `WRENCH`."""
        return self.followed.dimension

    @property
    def followed(self) -> Trajectory:
        """The command as a trajectory."""
        if self.trajectory is not None:
            return self.trajectory
        return Hold(np.atleast_1d(np.asarray(self.value)))

    @staticmethod
    def _check_dimension(key: str, n: int) -> None:
        if n not in (NORMAL, FORCE, WRENCH):
            with within(key):
                raise ContactError(
                    f"it has {n} coordinates; needs 1 (the normal force), 3 (the force "
                    "along two tangents and the normal), or 6 (with the moments)"
                )


def shares(dimension: int, arms: Array) -> Array:
    """Return the map (3 k, n) from a command's coordinates to the forces at the points.

    Of all forces with the commanded sum it gives those of least norm. The arms (k, 3)
    [m] are the points from their middle, in the axes of the contact.
    """
    k = len(arms)
    alike = np.tile(np.eye(3) / k, (k, 1))
    if dimension == NORMAL:
        return alike[:, 2:]
    if dimension == FORCE:
        return alike
    total = np.zeros((6, 3 * k))
    for p, (x, y, z) in enumerate(arms):
        own = slice(3 * p, 3 * p + 3)
        total[:3, own] = np.eye(3)
        total[3:, own] = [[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]
    return np.asarray(np.linalg.pinv(total, rcond=1e-9))


def check_points(forces: Array, side: float, wrench: bool) -> None:
    """Check that the forces at a contact's points (k, 3) [N] push and do not slip."""
    rounding = 1e-9 * (1.0 + float(np.abs(forces).max()))
    for k, (first, second, normal) in enumerate(forces):
        where = f" at point {k + 1} of {len(forces)}, its share of the wrench," * wrench
        if normal < -rounding:
            total = normal if wrench else float(forces[:, 2].sum())
            raise ContactError(
                f"the normal force{where} is {total:g} N; a contact pushes and cannot "
                "pull: must not be negative"
            )
        largest = max(abs(first), abs(second))
        if largest > side * normal + rounding:
            scale = 1 if wrench else len(forces)
            raise ContactError(
                f"the tangential force{where} is ({first * scale:g}, "
                f"{second * scale:g}) N beside a normal force of {normal * scale:g} N: "
                "outside the friction pyramid, which allows "
                f"{side * normal * scale:g} N along each tangent"
            )
