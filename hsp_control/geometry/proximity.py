"""Distances between pairs of shapes and their gradients, computed once per state."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.geometry.closed_form import ClosedFormDistances, has_closed_form
from hsp_control.geometry.coal_distances import CoalDistances
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.robot import Robot, RobotState


class Proximity:
    """Signed distances of pairs (link, obstacle) and (link, link).

    The gradient of a distance is ∇d = (J_1 - J_2)ᵀ n at the witness points, where n is
    the unit vector from the second point to the first; an obstacle has J_2 = 0. Pairs
    of spheres and capsules have a closed form, and so have a sphere and a box, cylinder
    or half-space; the rate of their gradient is exact. Coal computes all others.
    """

    def __init__(
        self,
        robot: Robot,
        links: Sequence[LinkShape],
        obstacles: Sequence[Obstacle],
        pairs: Sequence[tuple[int, int]],
    ) -> None:
        """Set up the pairs (link, other), indices into links and then obstacles."""
        if not pairs:
            raise FieldError("there are no pairs of shapes to keep apart")
        # (i, j) and (j, i) are one pair, as in Pinocchio.
        pairs = list({frozenset(pair): pair for pair in pairs}.values())
        self.robot = robot
        self.links = tuple(links)  # shapes of its links
        self.obstacles = tuple(obstacles)
        self.pairs = tuple(pairs)  # indices into links followed by obstacles
        # at the last `measure`, shape (k,) [m]; negative if shapes overlap
        self.distances: Array = np.zeros(len(pairs))
        items: list[LinkShape | Obstacle] = [*links, *obstacles]
        closed = np.array([has_closed_form(links[i], items[j]) for i, j in pairs])
        index = np.array(pairs, dtype=np.int64)
        # the pairs that have a closed form, or None
        self.closed_form: ClosedFormDistances | None = None
        self.coal: CoalDistances | None = None  # the other pairs, or None
        if closed.any():
            places = np.flatnonzero(closed)
            self.closed_form = ClosedFormDistances(
                robot, links, obstacles, index[closed], places
            )
        if not closed.all():
            places = np.flatnonzero(~closed)
            self.coal = CoalDistances(robot, links, obstacles, index[~closed], places)
        self._computed_by = [
            (self.closed_form if has else self.coal, int((closed == has)[:k].sum()))
            for k, has in enumerate(closed)
        ]
        self._measured: RobotState | None = None
        self._stamp = -1, -1

    def measure(self, state: RobotState) -> Array:
        """Return all distances at a state, shape (k,) [m]; computed once per state."""
        if self._measured is state and self._stamp == self._stamp_of(state):
            return self.distances  # compare the object: ids are reused
        if self.closed_form is not None:
            self.closed_form.measure(state, self.distances)
        if self.coal is not None:
            self.coal.measure(state, self.distances)
        self._measured, self._stamp = state, self._stamp_of(state)
        return self.distances

    def _stamp_of(self, state: RobotState) -> tuple[int, int]:
        """Return a value that changes when anything is measured at another state."""
        count = 0 if self.closed_form is None else int(self.closed_form.measurements[0])
        return state.stamp, count

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return the k-th pair's nearest points [m] and normal from first to second.

        All are in world axes; `measure` has been called.
        """
        computed_by, own = self._computed_by[k]
        assert computed_by is not None
        return computed_by.witness(own)

    def gradient(self, state: RobotState, slopes: Array) -> Array:
        """Return Σ slopes_k ∇d_k, shape (nv,); pairs with slope 0 are skipped."""
        self.measure(state)
        result, rate = np.zeros(self.robot.nv), np.zeros(self.robot.nv)
        if self.closed_form is not None:
            curvatures = np.zeros(len(slopes))
            self.closed_form.differentiate(state, slopes, curvatures, result, rate)
        if self.coal is not None:
            self.coal.add_gradient(state, slopes, result)
        return result

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the minimum distance [m] and the names of its pair, ``a to b``."""
        distances = self.measure(state)
        k = int(np.argmin(distances))
        names = [link.link for link in self.links] + [o.name for o in self.obstacles]
        first, second = self.pairs[k]
        return float(distances[k]), f"{names[first]} to {names[second]}"
