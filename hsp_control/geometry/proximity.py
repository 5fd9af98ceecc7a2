"""Distances between pairs of shapes, and their gradients, once per state."""

from collections.abc import Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import FieldError
from hsp_control.geometry.by_coal import ByCoal
from hsp_control.geometry.closed_form import ClosedForm, has_closed_form
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.robot import Robot, RobotState


class Proximity:
    """Signed distances of pairs (link, obstacle) and (link, link).

    The gradient of a distance is ∇d = (J_1 - J_2)ᵀ n at the witness points, n the unit
    vector from the second to the first; an obstacle has J_2 = 0. Balls, capsules and,
    before balls, boxes, cylinders and half-spaces have formulas, with the exact rate of
    that gradient; the others' distances are Coal's.

    Attributes:
        distances: At the last `measure`, shape (k,) [m]; negative where shapes overlap.
        formulas: The pairs that have formulas, if any.
        others: The pairs that have none, if any.
    """

    def __init__(
        self,
        robot: Robot,
        links: Sequence[LinkShape],
        obstacles: Sequence[Obstacle],
        pairs: Sequence[tuple[int, int]],
    ) -> None:
        """Prepare.

        Args:
            robot: The robot.
            links: Shapes of its links.
            obstacles: Obstacles.
            pairs: Indices into links followed by obstacles; the first is a link. A
                pair that is named twice counts once.

        Raises:
            FieldError: If there is no pair.
        """
        if not pairs:
            raise FieldError("no pair of shapes is left to keep apart")
        # In either order: so does Pinocchio.
        pairs = list({frozenset(pair): pair for pair in pairs}.values())
        self.robot = robot
        self.links = tuple(links)
        self.obstacles = tuple(obstacles)
        self.pairs = tuple(pairs)
        self.distances: Array = np.zeros(len(pairs))
        items: list[LinkShape | Obstacle] = [*links, *obstacles]
        known = np.array([has_closed_form(links[i], items[j]) for i, j in pairs])
        index = np.array(pairs, dtype=np.int64)
        self.formulas: ClosedForm | None = None
        self.others: ByCoal | None = None
        if known.any():
            places = np.flatnonzero(known)
            self.formulas = ClosedForm(robot, links, obstacles, index[known], places)
        if not known.all():
            places = np.flatnonzero(~known)
            self.others = ByCoal(robot, links, obstacles, index[~known], places)
        self._whose = [
            (self.formulas if has else self.others, int((known == has)[:k].sum()))
            for k, has in enumerate(known)
        ]
        self._measured: RobotState | None = None
        self._stamp = -1, -1

    def measure(self, state: RobotState) -> Array:
        """Return all distances at a state, computing them once."""
        if self._measured is state and self._stamp == self._stamp_of(state):
            return self.distances  # the state itself: an id would be used again
        if self.formulas is not None:
            self.formulas.measure(state, self.distances)
        if self.others is not None:
            self.others.measure(state, self.distances)
        self._measured, self._stamp = state, self._stamp_of(state)
        return self.distances

    def _stamp_of(self, state: RobotState) -> tuple[int, int]:
        """Return what is another one once anything was measured at another state."""
        count = 0 if self.formulas is None else int(self.formulas.measurements[0])
        return state.stamp, count

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return what realises the k-th distance, world axes, shape (3,) each.

        The points on the first and on the second shape [m], and the unit normal from
        the first to the second.
        """
        whose, own = self._whose[k]
        assert whose is not None
        return whose.witness(own)

    def gradient(self, state: RobotState, slopes: Array) -> Array:
        """Return Σ slopes_k ∇d_k, shape (nv,); pairs of slope 0 cost nothing.

        Args:
            state: The robot's state.
            slopes: ∂f/∂d_k, shape (k,).
        """
        self.measure(state)
        result, rate = np.zeros(self.robot.nv), np.zeros(self.robot.nv)
        if self.formulas is not None:
            bends = np.zeros(len(slopes))
            self.formulas.differentiate(state, slopes, bends, result, rate)
        if self.others is not None:
            self.others.add_gradient(state, slopes, result)
        return result

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the least distance [m] and which pair it is."""
        distances = self.measure(state)
        k = int(np.argmin(distances))
        names = [link.link for link in self.links] + [o.name for o in self.obstacles]
        first, second = self.pairs[k]
        return float(distances[k]), f"{names[first]} to {names[second]}"
