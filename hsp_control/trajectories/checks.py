"""What every trajectory asks of its arguments; each check returns a copy of its own."""

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError

_ORTHONORMAL = 1e-8  # largest entry of A Aᵀ - I that is put down to rounding


def array(value: ArrayLike, name: str, shape: tuple[int | None, ...]) -> Array:
    """Return ``value`` as an array of finite numbers; None in ``shape`` fits any size.

    Raises:
        TrajectoryError: If it is not one, or not of that shape.
    """
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


def number(value: float, name: str) -> float:
    """Return ``value`` as a finite number."""
    return float(array(value, name, ()))


def positive(value: float, name: str) -> float:
    """Return ``value`` as a positive number.

    Raises:
        TrajectoryError: If it is none.
    """
    result = number(value, name)
    if result <= 0.0:
        raise TrajectoryError(f"{name} must be positive; {name} = {result}")
    return result


def waypoint_times(value: ArrayLike, count: int) -> Array:
    """Return the times of ``count`` waypoints, shape (count,) [s].

    Raises:
        TrajectoryError: If there are fewer than two, or if they do not increase.
    """
    if count < 2:
        raise TrajectoryError(f"a path needs two waypoints or more; it has {count}")
    times = array(value, "times", (count,))
    for i in range(1, count):
        if times[i] <= times[i - 1]:
            raise TrajectoryError(
                f"waypoint times must increase; "
                f"times[{i}] = {times[i]} <= times[{i - 1}] = {times[i - 1]}"
            )
    return times


def direction(value: ArrayLike, name: str) -> Array:
    """Return the unit vector along ``value``, shape (3,).

    Raises:
        TrajectoryError: If it is zero.
    """
    vector = array(value, name, (3,))
    length = float(np.linalg.norm(vector))
    if not length > 0.0:
        raise TrajectoryError(f"{name} must have a direction; {name} = [0, 0, 0]")
    return vector / length


def orthonormal(value: ArrayLike, name: str, shape: tuple[int, int]) -> Array:
    """Return ``value``, a matrix of orthonormal rows.

    Raises:
        TrajectoryError: If the rows are not orthonormal.
    """
    matrix = array(value, name, shape)
    error = float(np.abs(matrix @ matrix.T - np.eye(shape[0])).max())
    if error > _ORTHONORMAL:
        raise TrajectoryError(
            f"the rows of {name} must be orthonormal; they are off by {error:.1e}"
        )
    return matrix


def rotation(value: ArrayLike, name: str) -> Array:
    """Return ``value``, a rotation matrix of shape (3, 3).

    Raises:
        TrajectoryError: If it is not orthonormal, or if it mirrors.
    """
    matrix = orthonormal(value, name, (3, 3))
    if np.linalg.det(matrix) < 0.0:
        raise TrajectoryError(f"{name} must be a rotation; it mirrors (determinant -1)")
    return matrix
