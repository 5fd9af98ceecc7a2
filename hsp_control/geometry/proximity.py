"""Distances between pairs of shapes, and their gradients, once per state (by Coal)."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.arrays import Array, Indices
from hsp_control.exceptions import FieldError
from hsp_control.geometry.links import LinkShape
from hsp_control.kernels import kernel
from hsp_control.kinematics import joint_support
from hsp_control.robot import Robot, RobotState
from hsp_control.scene import Obstacle

GJK_TOLERANCE = 1e-10
"""Coal's own is 1e-6, too coarse for the rates of gradients."""


class Proximity:
    """Signed distances of pairs (link, obstacle) and (link, link).

    The gradient of a distance is ∇d = (J_1 - J_2)ᵀ n at the witness points, n the unit
    vector from the second to the first; an obstacle has J_2 = 0.

    Attributes:
        distances: At the last `measure`, shape (k,) [m]; negative where shapes overlap.
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
        # Pinocchio, too, keeps each pair once, in either order.
        pairs = list({frozenset(pair): pair for pair in pairs}.values())
        self.robot = robot
        self.links = tuple(links)
        self.obstacles = tuple(obstacles)
        self.pairs = tuple(pairs)
        self._geometry = pin.GeometryModel()
        for i, link in enumerate(links):
            self._add(f"link {i}", link.joint, link.placement, link.geometry)
        for obstacle in obstacles:
            shape = obstacle.shape.geometry()
            self._add(obstacle.name, 0, obstacle.placement(0.0), shape)
        for first, second in pairs:
            self._geometry.addCollisionPair(pin.CollisionPair(first, second))
        self._data = pin.GeometryData(self._geometry)
        for request in self._data.distanceRequests:
            request.gjk_tolerance = GJK_TOLERANCE
            request.epa_tolerance = GJK_TOLERANCE
        count = len(pairs)
        self.distances: Array = np.zeros(count)
        self._results = list(self._data.distanceResults)  # references: they follow
        self._reversed = frozenset(
            k
            for k, (_, second) in enumerate(pairs)
            if second >= len(links) and obstacles[second - len(links)].shape.reversed
        )
        self._measured: tuple[RobotState, int] | None = None
        joints = [link.joint for link in links] + [0] * len(obstacles)
        support = {joint: joint_support(robot.model, joint) for joint in set(joints)}
        self._supports = [
            (*support[joints[first]], *support[joints[second]])
            for first, second in pairs
        ]

    def measure(self, state: RobotState) -> Array:
        """Return all distances at a state, computing them once."""
        measured = self._measured  # the state itself: an id would be used again
        if measured and measured[0] is state and measured[1] == state.stamp:
            return self.distances
        items = self._geometry.geometryObjects
        for index, obstacle in enumerate(self.obstacles, start=len(self.links)):
            items[index].placement = obstacle.placement(state.t)
        pin.updateGeometryPlacements(
            self.robot.model, state.data, self._geometry, self._data
        )
        pin.computeDistances(self._geometry, self._data)
        self.distances[:] = [result.min_distance for result in self._results]
        self._measured = (state, state.stamp)
        return self.distances

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return what realises the k-th distance, world axes, shape (3,) each.

        The points on the first and on the second shape [m], and the unit normal from
        the first to the second. Read when asked for: few pairs are near enough.
        """
        result = self._results[k]
        first, second = result.getNearestPoint1(), result.getNearestPoint2()
        if k in self._reversed:
            return second, first, -result.normal
        return first, second, result.normal

    def gradient(self, state: RobotState, slopes: Array) -> Array:
        """Return Σ slopes_k ∇d_k, shape (nv,); pairs of slope 0 cost nothing.

        Args:
            state: The robot's state.
            slopes: ∂f/∂d_k, shape (k,).
        """
        self.measure(state)
        result = np.zeros(self.robot.nv)
        for k in np.flatnonzero(slopes):
            columns, freedoms, columns2, freedoms2 = self._supports[k]
            first, second, normal = self.witness(int(k))
            force = -slopes[k] * normal
            J = state.world_jacobian
            _push(J, columns, freedoms, first, force, result)
            if len(columns2):
                _push(J, columns2, freedoms2, second, -force, result)
        return result

    def nearest(self, state: RobotState) -> tuple[float, str]:
        """Return the least distance [m] and which pair it is."""
        distances = self.measure(state)
        k = int(np.argmin(distances))
        names = [link.link for link in self.links] + [o.name for o in self.obstacles]
        first, second = self.pairs[k]
        return float(distances[k]), f"{names[first]} to {names[second]}"

    def _add(self, name: str, joint: int, placement: pin.SE3, geometry: Any) -> None:
        self._geometry.addGeometryObject(
            pin.GeometryObject(name, joint, placement, geometry)
        )


@kernel
def _push(
    J_world: Array,
    columns: Indices,
    freedoms: Indices,
    point: Array,
    force: Array,
    out: Array,
) -> None:
    """Add J(point)ᵀ force, J the linear Jacobian of a point of the supporting joint."""
    mx = point[1] * force[2] - point[2] * force[1]
    my = point[2] * force[0] - point[0] * force[2]
    mz = point[0] * force[1] - point[1] * force[0]
    for k in range(columns.shape[0]):
        c = columns[k]
        out[freedoms[k]] += (
            J_world[0, c] * force[0]
            + J_world[1, c] * force[1]
            + J_world[2, c] * force[2]
            + J_world[3, c] * mx
            + J_world[4, c] * my
            + J_world[5, c] * mz
        )
