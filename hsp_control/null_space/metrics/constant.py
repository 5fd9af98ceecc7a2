"""A constant metric, given as a matrix."""

from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from hsp_control.common.arrays import Array
from hsp_control.declaration.quantities import ArrayField, Number, read_only
from hsp_control.null_space.metrics.fixed import FixedMetric

_Row = Annotated[list[Number], Field(min_length=1)]


def _array(value: list[Any]) -> Array:
    """Return the matrix or its diagonal, read-only."""
    if len({isinstance(entry, list) for entry in value}) > 1:
        raise ValueError("mixes numbers and rows; needs rows, or numbers (a diagonal)")
    return read_only(value)


_Entries = Annotated[list[Number | _Row], Field(min_length=1)]


class ConstantMetric(FixedMetric, type="constant"):
    """W = const, symmetric positive definite: weighted joints."""

    matrix: Annotated[ArrayLike, ArrayField(_Entries, _array)]
    """W, shape (nv, nv), or its diagonal, shape (nv,) [-]."""

    def __post_init__(self) -> None:
        """Check the matrix."""
        self.W  # noqa: B018 (computed, checked and kept)

    def _matrix(self) -> Array:
        matrix = np.array(self.matrix)
        return np.diag(matrix) if matrix.ndim == 1 else matrix
