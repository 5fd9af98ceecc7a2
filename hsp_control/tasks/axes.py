"""World axes by their letters, and a point that is tracked along some of them."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import TaskError
from hsp_control.common.kernels import kernel
from hsp_control.tasks.task import track


def axis_indices(axes: str | Sequence[str]) -> Indices:
    """Return the indices that ``"xz"`` or ``["x", "z"]`` name.

    Raises:
        TaskError: If they are not distinct letters of "xyz", at least one.
    """
    letters = "".join(axes)
    if not letters or len(set(letters)) < len(letters) or set(letters) - set("xyz"):
        raise TaskError(f"axes {letters!r}: name distinct axes among x, y and z")
    return np.array(["xyz".index(letter) for letter in letters], dtype=np.int64)


@kernel
def track_axes(
    axes: Indices,
    J_point: Array,
    J_point_dot: Array,
    position: Array,
    velocity: Array,
    x_d: Array,
    x_d_dot: Array,
    x_d_ddot: Array,
    Kp: Array,
    Kv: Array,
    offset: Array,
    J: Array,
    J_dot: Array,
    e: Array,
    e_dot: Array,
    a_x: Array,
) -> None:
    """Write the sample of a point's axes; a_x = x_d'' + Kv e' + Kp e."""
    for k in range(axes.shape[0]):
        i = axes[k]
        for j in range(J.shape[1]):
            J[k, j] = J_point[i, j]
            J_dot[k, j] = J_point_dot[i, j]
        e[k] = x_d[k] - position[i]
        e_dot[k] = x_d_dot[k] - velocity[i]
    track(x_d_ddot, Kp, Kv, offset, e, e_dot, a_x)
