"""Distances by Coal, for pairs without a closed form: meshes, hulls, clouds."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
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
        """Create the geometry; see `ClosedFormDistances` for the arguments."""
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
        """Return the witness points [m] and the unit normal from first to second.

        For the k-th of these pairs, in world axes, shape (3,) each. They are read from
        Coal on demand, since few pairs are close enough to need them.
        """
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
            _add_force(J, columns, dofs, first, force, gradient)
            if len(columns2):
                _add_force(J, columns2, dofs2, second, -force, gradient)

    def _add(self, name: str, joint: int, placement: pin.SE3, geometry: Any) -> None:
        self._geometry.addGeometryObject(
            pin.GeometryObject(name, joint, placement, geometry)
        )


@kernel
def _add_force(
    J_world: Array,
    columns: Indices,
    dofs: Indices,
    point: Array,
    force: Array,
    out: Array,
) -> None:
    """Add J(point)ᵀ force to ``out``; J is the linear Jacobian of a point on a link."""
    mx = point[1] * force[2] - point[2] * force[1]
    my = point[2] * force[0] - point[0] * force[2]
    mz = point[0] * force[1] - point[1] * force[0]
    for k in range(columns.shape[0]):
        c = columns[k]
        out[dofs[k]] += (
            J_world[0, c] * force[0]
            + J_world[1, c] * force[1]
            + J_world[2, c] * force[2]
            + J_world[3, c] * mx
            + J_world[4, c] * my
            + J_world[5, c] * mz
        )
