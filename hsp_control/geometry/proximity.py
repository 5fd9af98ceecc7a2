"""Distances of pairs of shapes, by Coal or in closed form, and their gradients."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import FieldError
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.geometry.closed_form import ClosedFormDistances, has_closed_form
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import joint_support

GJK_TOLERANCE = 1e-10
"""Coal's default is 1e-6, which is too coarse for differences of gradients."""


class CoalDistances:
    """Distances by Coal at one state, and weighted sums of their gradients."""

    def __init__(
        self,
        robot: Robot,
        links: Sequence[LinkShape],
        obstacles: Sequence[Obstacle],
        pairs: Indices,
        places: Indices,
    ) -> None:
        self._robot, self._obstacles = robot, tuple(obstacles)
        self._first_obstacle = len(links)
        # index of each pair in the `Proximity`, shape (k,)
        self._pairs, self.places = pairs, places
        self._geometry = pin.GeometryModel()
        for i, link in enumerate(links):
            self._add(f"link {i}", link.joint, link.placement, link.geometry)
        for obstacle in obstacles:
            shape = obstacle.shape.geometry()
            self._add(obstacle.name, 0, obstacle.placement(0.0), shape)
        for first, second in pairs.tolist():
            self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._data = pin.GeometryData(self._geometry)
        for request in self._data.distanceRequests:
            request.gjk_tolerance = GJK_TOLERANCE
            request.epa_tolerance = GJK_TOLERANCE
        self._results = list(
            self._data.distanceResults
        )  # references: computeDistances updates them
        self._reversed = frozenset(
            k
            for k, second in enumerate(pairs[:, 1].tolist())
            if second >= len(links)
            and obstacles[second - len(links)].shape.witness_reversed
        )
        joints = [link.joint for link in links] + [0] * len(obstacles)
        support = {joint: joint_support(robot.model, joint) for joint in set(joints)}
        self._supports = [
            (*support[joints[first]], *support[joints[second]])
            for first, second in pairs.tolist()
        ]

    def measure(self, state: RobotState, distances: Array) -> None:
        """Write the distances [m] at the indices ``places`` of ``distances``."""
        items = self._geometry.geometryObjects
        for index, obstacle in enumerate(self._obstacles, start=self._first_obstacle):
            items[index].placement = obstacle.placement(state.t)
        pin.updateGeometryPlacements(
            self._robot.model, state.data, self._geometry, self._data
        )
        pin.computeDistances(self._geometry, self._data)
        distances[self.places] = [result.min_distance for result in self._results]

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return the k-th pair's witness points [m] and normal, from Coal."""
        result = self._results[k]
        first, second = result.getNearestPoint1(), result.getNearestPoint2()
        if k in self._reversed:
            return second, first, -result.normal
        return first, second, result.normal

    def add_gradient(self, state: RobotState, slopes: Array, gradient: Array) -> None:
        """Add Σ b'(d_k) ∇d_k, shape (nv,), after `measure` at the same state."""
        own = slopes[self.places]
        J = state.world.jacobian
        for k in np.flatnonzero(own).tolist():
            columns, dofs, columns2, dofs2 = self._supports[k]
            first, second, normal = self.witness(k)
            force = -own[k] * normal
            add = partial(engine.AddForce, jacobian=J, out=gradient)
            add(columns=columns, dofs=dofs, point=first, force=force)()
            if len(columns2):
                add(columns=columns2, dofs=dofs2, point=second, force=-force)()

    def _add(self, name: str, joint: int, placement: pin.SE3, geometry: Any) -> None:
        self._geometry.addGeometryObject(
            pin.GeometryObject(name, joint, placement, geometry)
        )


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
                robot, links, obstacles, index[closed], places, self.distances
            )
        if not closed.all():
            places = np.flatnonzero(~closed)
            self.coal = CoalDistances(robot, links, obstacles, index[~closed], places)
        self._computed_by = [
            (self.closed_form if has else self.coal, int((closed == has)[:k].sum()))
            for k, has in enumerate(closed)
        ]
        self._measured: Indices | None = None
        self._stamp = -1, -1

    def measure(self, state: RobotState) -> Array:
        """Return all distances at a state, shape (k,) [m]; computed once per state."""
        # The array is that of the state and of its read-only views: ids are reused.
        if self._measured is state.stamp_array and (
            self._stamp == self._stamp_of(state)
        ):
            return self.distances
        if self.closed_form is not None:
            self.closed_form.measure(state)
        if self.coal is not None:
            self.coal.measure(state, self.distances)
        self._measured, self._stamp = state.stamp_array, self._stamp_of(state)
        return self.distances

    def calls(self, state: RobotState) -> PartCalls:
        """Return the calls that write `distances` for this state."""
        if self.closed_form is None or self.coal is not None:
            return [PartCall(self.measure, state=state)]
        return self.closed_form.calls(state)

    def row_call(
        self, state: RobotState, near: Indices, least: Array, rows: tuple[Any, ...]
    ) -> PartCall:
        """Return a call that adds rows ∇d·a ≥ least, after `calls`.

        Args:
            state: The state.
            near: Whether a pair has a row, shape (k,).
            least: Lower bound of each row, shape (k,).
            rows: The rows to which they are added: their number, A and least.
        """
        if self.closed_form is not None and self.coal is None:
            return self.closed_form.row_call(state, near, least, rows)
        number, A, all_least = rows

        def add() -> None:
            chosen, first = np.flatnonzero(near), number.item()
            number[0] = end = first + len(chosen)
            A[first:end] = self.gradients(state, chosen)
            all_least[first:end] = least[chosen]

        return PartCall(add)

    def _stamp_of(self, state: RobotState) -> tuple[int, int]:
        """Return a value that changes with every measurement at another state."""
        count = 0 if self.closed_form is None else int(self.closed_form.measurements[0])
        return state.stamp, count

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return the k-th pair's nearest points [m] and normal from first to second."""
        computed_by, own = self._computed_by[k]
        assert computed_by is not None
        return computed_by.witness(own)

    def gradient(self, state: RobotState, slopes: Array) -> Array:
        """Return Σ slopes_k ∇d_k, shape (nv,); pairs with slope 0 are skipped."""
        self.measure(state)
        return self._gradient(state, slopes)

    def gradients(self, state: RobotState, pairs: Sequence[int] | Indices) -> Array:
        """Return ∇d of some pairs, shape (number of pairs, nv)."""
        self.measure(state)
        slopes = np.zeros((len(pairs), len(self.pairs)))
        slopes[np.arange(len(pairs)), pairs] = 1.0
        rows = [self._gradient(state, each) for each in slopes]
        return np.array(rows).reshape(-1, state.robot.nv)

    def _gradient(self, state: RobotState, slopes: Array) -> Array:
        gradient = np.zeros(state.robot.nv)
        if self.closed_form is not None:
            gradient[:] = self.closed_form.differentiate(state, slopes, 0.0)[0]
        if self.coal is not None:
            self.coal.add_gradient(state, slopes, gradient)
        return gradient

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the minimum distance [m] and the names of its pair, ``a to b``."""
        distances = self.measure(state)
        k = int(np.argmin(distances))
        names = [link.link for link in self.links] + [o.name for o in self.obstacles]
        first, second = self.pairs[k]
        return float(distances[k]), f"{names[first]} to {names[second]}"
