"""Checks of the arguments of trajectories, which return new, checked copies."""

from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ShapeError, TrajectoryError
from hsp_control.declaration.language import kind
from hsp_control.declaration.rotation import matrix_of

Sample = TypeVar("Sample")

_ORTHONORMAL = 1e-8  # largest entry of A Aᵀ - I that may be rounding error


def array(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Array:
    """Return ``value`` as finite numbers; None in ``shape`` fits any size."""
    wanted = f"({', '.join('n' if n is None else str(n) for n in shape)})"
    try:
        result = np.array(value, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise TrajectoryError(
            f"{name} must be numbers of shape {wanted}; {name} = {value!r}"
        ) from error
    fits = result.ndim == len(shape) and all(
        size > 0 if n is None else size == n
        for size, n in zip(result.shape, shape, strict=True)
    )
    if not fits:
        raise TrajectoryError(f"{name} must have shape {wanted}; it has {result.shape}")
    if not np.isfinite(result).all():
        raise TrajectoryError(f"{name} must be finite; {name} = {result.tolist()}")
    return result


def output(out: object, sample: type[Sample], size: str = "") -> Sample:
    """Return ``out``, which is to be a sample, of ``size``."""
    if not isinstance(out, sample):
        needs = f"{sample.__name__}.allocate({size})"
        raise ShapeError(f"out is {kind(out)}; needs {needs}")
    return out


def waypoint_times(value: ArrayLike, count: int) -> Array:
    """Return the times of ``count`` waypoints, shape (count,) [s]."""
    if count < 2:
        raise TrajectoryError(f"a path needs at least two waypoints; it has {count}")
    times = array(value, "times", (count,))
    for i in range(1, count):
        if times[i] <= times[i - 1]:
            raise TrajectoryError(
                f"waypoint times must increase; "
                f"times[{i}] = {times[i]} <= times[{i - 1}] = {times[i - 1]}"
            )
    return times


def direction(value: ArrayLike, name: str) -> Array:
    """Return the unit vector along ``value``, shape (3,)."""
    vector = array(value, name, (3,))
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise TrajectoryError(f"{name} must be non-zero; {name} = [0, 0, 0]")
    return vector / length


def orthonormal(value: ArrayLike, name: str, shape: tuple[int, int]) -> Array:
    """Return ``value`` as a matrix with orthonormal rows."""
    matrix = array(value, name, shape)
    error = float(np.abs(matrix @ matrix.T - np.eye(shape[0])).max())
    if error > _ORTHONORMAL:
        raise TrajectoryError(
            f"the rows of {name} must be orthonormal; the largest entry of A Aᵀ - I "
            f"is {error:.1e}"
        )
    return matrix


def rotation(value: ArrayLike, name: str) -> Array:
    """Return ``value`` as a rotation matrix of shape (3, 3)."""
    try:
        return matrix_of(array(value, name, (3, 3)), name)
    except ValueError as error:
        raise TrajectoryError(str(error)) from None
