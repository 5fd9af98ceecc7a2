"""Orientations, as users type them."""

from typing import Annotated, Any, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike
from pydantic import BeforeValidator, WithJsonSchema

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import ArrayField, Number, read_only

_ROUNDING = 1e-8
"""Deviation from norm 1, or from orthonormal rows, that is accepted as rounding."""


def matrix_of(rotation: ArrayLike, name: str = "rotation") -> Array:
    """Return the rotation matrix of a `Rotation`, body to world, shape (3, 3)."""
    given = np.asarray(rotation, dtype=float)
    if given.shape == (3,):
        return np.array(pin.rpy.rpyToMatrix(*given))
    if given.shape == (4,):
        norm = float(np.linalg.norm(given))
        if abs(norm - 1.0) > _ROUNDING:
            raise ValueError(
                f"the quaternion {name} must have norm 1; it has {norm:.9g}"
            )
        return np.array(pin.Quaternion(given).toRotationMatrix())
    if given.shape != (3, 3):
        raise ValueError(
            f"{name} has shape {given.shape}; needs (3,) for roll, pitch and yaw, (4,) "
            "for a quaternion, or (3, 3) for a matrix"
        )
    error = float(np.abs(given @ given.T - np.eye(3)).max())
    if error > _ROUNDING:
        raise ValueError(
            f"the rows of {name} must be orthonormal; the largest entry of A Aᵀ - I "
            f"is {error:.1e}"
        )
    if np.linalg.det(given) < 0.0:
        raise ValueError(
            f"{name} must be a rotation; it is a reflection (determinant -1)"
        )
    return given.copy()


def _coefficients(value: Any) -> Any:
    """Return a quaternion of Pinocchio as numbers (x, y, z, w), others as they are."""
    return value.coeffs() if isinstance(value, pin.Quaternion) else value


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

# Their sizes are checked by `matrix_of`, whose message explains the sizes.
Rotation = Annotated[
    ArrayLike,
    ArrayField(list[Number] | list[list[Number]], _checked),
    WithJsonSchema(_SCHEMA),
    BeforeValidator(_coefficients),
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
AnyRotation: TypeAlias = ArrayLike | pin.Quaternion
"""What an orientation may be given as: see `Rotation`."""
