"""Orientations, as a person types them."""

from typing import Annotated, Any

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import WithJsonSchema

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.declaration.quantities import ArrayField, Number, read_only
from hsp_control.trajectories import checks


def matrix_of(rotation: ArrayLike, name: str = "rotation") -> Array:
    """Return the rotation matrix of a `Rotation`, body to world, shape (3, 3).

    Args:
        rotation: See `Rotation`.
        name: What messages call it.

    Raises:
        TrajectoryError: If it is none: a matrix that is not orthonormal or a
            reflection, a quaternion that has not norm 1, or another shape.
    """
    given = np.asarray(rotation, dtype=float)
    if given.shape == (3,):
        return np.array(pin.rpy.rpyToMatrix(*given))
    if given.shape == (4,):
        quaternion = pin.Quaternion(checks.unit(given, f"the quaternion {name}"))
        return np.array(quaternion.toRotationMatrix())
    if given.shape != (3, 3):
        raise TrajectoryError(
            f"{name} has shape {given.shape}; needs (3,) for roll, pitch and yaw, (4,) "
            "for a quaternion, or (3, 3) for a matrix"
        )
    return checks.rotation(given, name)


def _checked(value: object) -> Array:
    array = read_only(value)
    matrix_of(array)
    return array


def _all_checked(value: object) -> Array:
    array = read_only(value)
    for i, each in enumerate(array):
        matrix_of(each, f"rotations[{i}]")
    return array


def _lists(items: dict[str, Any], fewest: int, most: int) -> dict[str, Any]:
    return {"type": "array", "items": items, "minItems": fewest, "maxItems": most}


_ROW = _lists({"type": "number"}, 3, 4)
_MATRIX = _lists(_lists({"type": "number"}, 3, 3), 3, 3)
_SCHEMA = {"anyOf": [_ROW, _MATRIX]}

# Their sizes are checked by `matrix_of`, which can say what each size means.
Rotation = Annotated[
    ArrayLike,
    ArrayField(list[Number] | list[list[Number]], _checked),
    WithJsonSchema(_SCHEMA),
]
"""Roll, pitch and yaw [rad], shape (3,); a quaternion (x, y, z, w) [-], shape (4,); or
a matrix, body to world [-], shape (3, 3)."""
Rotations = Annotated[
    ArrayLike,
    ArrayField(list[list[Number]] | list[list[list[Number]]], _all_checked),
    WithJsonSchema(
        {"anyOf": [{"type": "array", "items": each} for each in (_ROW, _MATRIX)]}
    ),
]
"""Several of one kind."""
