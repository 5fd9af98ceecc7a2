"""World axes by their letters."""

from collections.abc import Sequence

import numpy as np

from hsp_control.arrays import Indices
from hsp_control.exceptions import TaskError


def axis_indices(axes: str | Sequence[str]) -> Indices:
    """Return the indices that ``"xz"`` or ``["x", "z"]`` name.

    Raises:
        TaskError: If they are not distinct letters of "xyz", at least one.
    """
    letters = "".join(axes)
    if not letters or len(set(letters)) < len(letters) or set(letters) - set("xyz"):
        raise TaskError(f"axes {letters!r}: name distinct axes among x, y and z")
    return np.array(["xyz".index(letter) for letter in letters], dtype=np.int64)
