"""Minimum distances, as bounds on the acceleration."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Annotated, Self

import numpy as np
from pydantic import AfterValidator, Field

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LimitError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Names, NonNegative
from hsp_control.geometry.start import Start
from hsp_control.null_space.fields import Clearance, ObstacleClearance, SelfClearance
from hsp_control.null_space.fields.clearance import ObstacleOrName
from hsp_control.robot import RobotState

_STEP = 3e-4
"""Step of the differences along the motion [s]: rounding and truncation errors are
equal near 1e-8."""
_AHEAD = 0.5
"""A pair gets a row if its distance may come close to the minimum within this time [s]
at its present rate."""


class MinimumDistance(Part, ABC, family="distances", error=LimitError):
    """The distances of some pairs of shapes stay above a minimum.

    With h = d - minimum, the rows require h'' + 2α h' + α² h ≥ 0 (an exponential
    control barrier function). h'' = ∇d·a + the drift of d' at constant velocity; the
    drift includes the motion of the obstacles and of the nearest points.

    A subclass implements `clearance` and, if it refers to the scene, `placed`. `rows`
    and `check_start` are for placed ones.
    """

    minimum: NonNegative
    """The minimum distance [m]."""

    @property
    @abstractmethod
    def clearance(self) -> Clearance:
        """The field that knows the pairs of shapes."""

    def placed(self, start: Start) -> Self:
        """Return the distances with obstacles instead of their names, checked."""
        self.clearance.proximity(start.state)
        return self

    def rows(self, state: RobotState, bandwidth: float) -> tuple[Array, Array]:
        """Return the rows A a ≥ b, (k, nv) and (k,), of pairs close or approaching."""
        proximity = self.clearance.proximity(state)
        d = proximity.measure(state).copy()
        ahead = self._distances(state.ahead(_STEP))
        behind = self._distances(state.ahead(-_STEP))
        rate = (ahead - behind) / (2.0 * _STEP)
        drift = (ahead - 2.0 * d + behind) / _STEP**2
        h = d - self.minimum
        near = np.flatnonzero(h + _AHEAD * np.minimum(rate, 0.0) < 2.0 / bandwidth)
        A = np.zeros((len(near), state.robot.nv))
        for row, k in enumerate(near):
            slopes = np.zeros(len(d))
            slopes[k] = 1.0
            A[row] = proximity.gradient(state, slopes)
        b = -drift - 2.0 * bandwidth * rate - bandwidth**2 * h
        return A, b[near]

    def _distances(self, state: RobotState) -> Array:
        return self.clearance.proximity(state).measure(state).copy()

    def check_start(self, state: RobotState) -> None:
        """Check that no pair starts closer than the minimum distance."""
        distance, pair = self.clearance.proximity(state).nearest(state)
        if distance < self.minimum:
            raise LimitError(
                f"the start is outside the limits: {pair} are {distance:.4g} m apart, "
                f"must be at least {self.minimum:g} m"
            )


class ObstacleDistance(MinimumDistance, type="obstacles"):
    """Minimum distance between links and obstacles."""

    minimum: NonNegative = 0.02
    """The minimum distance [m]."""
    _: KW_ONLY
    obstacles: (
        Annotated[Sequence[ObstacleOrName], Field(min_length=1), AfterValidator(tuple)]
        | None
    ) = None
    """Names of the obstacles; or, in Python, the obstacles themselves [-]; all of the
    scene by default."""
    links: Names | None = None
    """Names of the links [-]; all moving links by default."""

    @cached_property
    def clearance(self) -> ObstacleClearance:
        """The field that knows the pairs of shapes."""
        return ObstacleClearance(obstacles=self.obstacles, links=self.links)

    def placed(self, start: Start) -> Self:
        """Return the distances, checked; see `MinimumDistance.placed`."""
        obstacles = self.clearance.fitted(start).obstacles
        return super(ObstacleDistance, replace(self, obstacles=obstacles)).placed(start)


class SelfDistance(MinimumDistance, type="self"):
    """Minimum distance between links."""

    minimum: NonNegative = 0.01
    """The minimum distance [m]."""

    @cached_property
    def clearance(self) -> SelfClearance:
        """The field that knows the pairs of shapes."""
        return SelfClearance()
