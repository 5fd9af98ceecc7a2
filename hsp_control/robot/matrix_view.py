"""Matrices of Pinocchio's with a column for every freedom, however few there are."""

from hsp_control.common.arrays import Array


def matrix_view(matrix: Array) -> Array:
    """Return a matrix of Pinocchio's as one, a view that follows its memory.

    Those of a single column come to Python as vectors: where a robot has one freedom.
    """
    return matrix.reshape(-1, 1) if matrix.ndim == 1 else matrix
