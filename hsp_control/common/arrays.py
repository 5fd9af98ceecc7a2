"""Array types; docstrings give the shapes."""

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
Flags = NDArray[np.bool_]


def read_only_view(array: Array) -> Array:
    """Return a view that cannot be written."""
    view = array.view()
    view.flags.writeable = False
    return view


def matrix_view(matrix: Array) -> Array:
    """Return a matrix of Pinocchio's as a view of two dimensions, also if nv = 1."""
    return matrix.reshape(-1, 1) if matrix.ndim == 1 else matrix
