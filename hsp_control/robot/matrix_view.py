"""Views of Pinocchio's matrices that keep two dimensions, also for nv = 1."""

from hsp_control.common.arrays import Array


def matrix_view(matrix: Array) -> Array:
    """Return a matrix of Pinocchio's data as a two-dimensional view of its memory."""
    return matrix.reshape(-1, 1) if matrix.ndim == 1 else matrix
