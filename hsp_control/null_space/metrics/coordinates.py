"""The metric of joint coordinates: the paper's law in coordinates θ = A q."""

from dataclasses import replace
from typing import Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import MetricError
from hsp_control.declaration.quantities import Matrix
from hsp_control.geometry.start import Start
from hsp_control.null_space.metrics.fixed import FixedMetric


class CoordinatesMetric(FixedMetric, type="coordinates"):
    """W = AᵀA, Euclidean in the joint coordinates θ = A q.

    The law then equals the paper's law in these coordinates, because a pseudo-inverse
    changes with the coordinates (docs/law.md).
    """

    matrix: Matrix | None = None
    """A, invertible, shape (nv, nv) [-]; as the robot's source defines it by
    default."""

    def __post_init__(self) -> None:
        """Check the matrix."""
        if self.matrix is not None:
            self.W  # noqa: B018 (computed, checked and kept)

    def placed(self, start: Start) -> Self:
        """Return the metric with A as a matrix, checked; see `Metric.placed`."""
        if self.matrix is not None:
            return super().placed(start)
        A = start.state.robot.joint_coordinates
        if A is None:
            raise MetricError(
                f"{start.state.robot.name} defines no joint coordinates; give matrix"
            )
        return replace(self, matrix=A)

    def _matrix(self) -> Array:
        if self.matrix is None:
            raise MetricError("the robot knows these coordinates: place the metric")
        A = np.asarray(self.matrix)
        if A.shape[0] != A.shape[1]:
            raise MetricError(f"the coordinates have shape {A.shape}; need (nv, nv)")
        return np.asarray(A.T @ A)
