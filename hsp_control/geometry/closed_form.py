"""Distances in closed form, with the exact rate of their gradients.

A link is a sphere or a capsule: all points within a radius of a segment, its core. The
other shape is such a link, an obstacle that is a sphere or a capsule, or, if the link
is a sphere, a solid (box, cylinder or half-space). The mathematics is in the engine,
engine/geometry/distances.hpp.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import coal
import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, HalfSpace, Shape, Sphere
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import joint_support

SEGMENT, BOX, CYLINDER, HALF_SPACE = 0, 1, 2, 3
"""Kinds of bodies, as the engine has them; a sphere is a segment of length zero."""

MOTION_SIZE = 18
"""Size of an obstacle's motion, R, c, c' and ω: see `Obstacle.follow`."""


def has_closed_form(first: LinkShape, second: LinkShape | Obstacle) -> bool:
    """Return whether the distance of a link to a link or obstacle has a closed form."""
    if not isinstance(first.geometry, coal.Sphere | coal.Capsule):
        return False
    if isinstance(second, LinkShape):
        return isinstance(second.geometry, coal.Sphere | coal.Capsule)
    if isinstance(second.shape, Sphere | Capsule):
        return True
    is_sphere = isinstance(first.geometry, coal.Sphere)
    return is_sphere and isinstance(second.shape, Box | Cylinder | HalfSpace)


class ClosedFormDistances:
    """Distances in closed form at one state, and weighted sums of their gradients."""

    def __init__(
        self,
        robot: Robot,
        links: Sequence[LinkShape],
        obstacles: Sequence[Obstacle],
        pairs: Indices,
        places: Indices,
        distances: Array,
    ) -> None:
        """Allocate; `measure` writes ``distances`` of all pairs at ``places``."""
        used = np.unique(pairs)
        self._motion = np.zeros((len(obstacles), MOTION_SIZE))
        self._moving: PartCalls = [
            call
            for k, obstacle in enumerate(obstacles)
            if len(links) + k in used
            for call in obstacle.calls(self._motion[k])
        ]
        solids = [_obstacle(obstacle.shape) for obstacle in obstacles]
        rows = [_link(link) for link in links] + [row for _, row in solids]
        self._sizes = np.array(rows).reshape(-1, 7)
        supports = {i: joint_support(robot.model, i) for i in {x.joint for x in links}}
        self._kinds: Indices = np.zeros((len(rows), 4), dtype=np.int64)
        columns, dofs, end = [], [], 0
        for i, link in enumerate(links):
            own_columns, own_dofs = supports[link.joint]
            columns.append(own_columns)
            dofs.append(own_dofs)
            self._kinds[i] = SEGMENT, link.joint, end, end + len(own_columns)
            end += len(own_columns)
        for k, (kind, _) in enumerate(solids):
            self._kinds[len(links) + k] = kind, -1 - k, 0, 0
        moved = np.concatenate(columns), np.concatenate(dofs)
        self._bodies = _Bodies(self._kinds, self._sizes, self._motion, *moved)
        self._used: Indices = used[self._kinds[used, 0] == SEGMENT]
        self._segments = np.zeros((len(rows), 2, 3))
        self._cores = np.zeros((len(pairs), 3, 3))
        self._distances = distances
        sums = np.zeros((2, len(distances))), np.zeros((2, robot.nv))
        self._sums = _Sums(*sums[0], *sums[1])
        # two bodies and the place of each pair, shape (k, 3)
        self._pairs: Indices = np.ascontiguousarray(np.column_stack([pairs, places]))
        # number of calls of `measure`, at any state, shape (1,)
        self.measurements: Indices = np.zeros(1, dtype=np.int64)

    def measure(self, state: RobotState) -> None:
        """Write the distances [m]."""
        calls = state.cached(self, "distances", lambda: state.plan(self.calls(state)))
        calls.run(state.t)

    def calls(self, state: RobotState) -> PartCalls:
        """Return the calls of `measure` for this state."""
        call = PartCall(
            engine.MeasureDistances,
            measurements=self.measurements,
            placements=state.world.placements,
            bodies=self,  # see `supplied`
            used=self._used,
            pairs=self._pairs,
            segments=self._segments,
            cores=self._cores,
            distances=self._distances,
        )
        return [call]

    def row_call(
        self, state: RobotState, near: Indices, least: Array, rows: tuple[Any, ...]
    ) -> PartCall:
        """Return the call that adds rows of single distances; see `Proximity`."""
        return PartCall(
            engine.DistanceRows,
            jacobian=state.world.jacobian,
            bodies=self._bodies,
            pairs=self._pairs,
            cores=self._cores,
            near=near,
            least_of_all=least,
            rows=rows,
        )

    def supplied(self) -> "tuple[_Bodies, PartCalls]":
        """Return the bodies as the engine reads them, and the calls that move them."""
        return self._bodies, self._moving

    def witness(self, k: int) -> tuple[Array, Array, Array]:
        """Return the witness points [m] and the unit normal from first to second."""
        x, y, n = self._cores[k]
        first, second = self._sizes[self._pairs[k, :2], 6]
        return x - first * n, y + second * n, -n

    def differentiate(
        self, state: RobotState, slopes: Array, curvatures: Array | float
    ) -> tuple[Array, Array]:
        """Return Σ b'(d_k) ∇d_k and its rate, (nv,), after `measure` at this state.

        ``slopes`` and ``curvatures`` are b' and b'' of all distances. The next call
        overwrites the result.
        """
        sums = self._sums
        run = state.cached(
            self,
            "derivatives",
            lambda: state.plan(self.derivatives(state, **sums._asdict())).call(),
        )
        sums.slopes[:], sums.curvatures[:] = slopes, curvatures
        run()
        return sums.gradient, sums.rate

    def derivatives(
        self,
        state: RobotState,
        slopes: Array,
        curvatures: Array,
        gradient: Array,
        rate: Array,
    ) -> PartCalls:
        """Return the calls of `differentiate` for these arguments."""
        call = PartCall(
            engine.DistanceGradients,
            world=state.world,
            bodies=self._bodies,
            pairs=self._pairs,
            segments=self._segments,
            slopes=slopes,
            curvatures=curvatures,
            gradient=gradient,
            rate=rate,
        )
        return [call]


def _link(link: LinkShape) -> list[float]:
    """Return a link's segment in its joint's frame (start, axis) and its radius."""
    half = getattr(link.geometry, "halfLength", 0.0)
    axis = half * link.placement.rotation[:, 2]
    center = link.placement.translation
    radius = getattr(link.geometry, "radius", 0.0)
    return [*(center - axis), *(2.0 * axis), radius]


def _obstacle(shape: Shape) -> tuple[int, list[float]]:
    """Return the kind of an obstacle, and its segment or size in its own frame."""
    if isinstance(shape, Sphere):
        return SEGMENT, [0.0] * 6 + [shape.radius]
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length
        return SEGMENT, [0.0, 0.0, -half, 0.0, 0.0, shape.length, shape.radius]
    if isinstance(shape, Box):
        return BOX, [*(0.5 * np.asarray(shape.size)), 0.0, 0.0, 0.0, 0.0]
    if isinstance(shape, Cylinder):
        size = [shape.radius, shape.radius, 0.5 * shape.length]
        return CYLINDER, [*size, 0.0, 0.0, 0.0, 0.0]
    return HALF_SPACE, [0.0] * 7


class _Bodies(NamedTuple):
    """Links, then obstacles."""

    # kind, joint (-1 - k for the k-th obstacle), and where the columns of the joint
    # begin and end, shape (n, 4)
    kinds: Indices
    # segment and radius, or half sizes, in the body's own frame, shape (n, 7)
    sizes: Array
    motion: Array  # placement and velocity of the obstacles, see `Obstacle.follow`
    columns: Indices  # the columns of the joints' Jacobian that move each link
    dofs: Indices  # the indices in v of these columns


class _Sums(NamedTuple):
    """Σ b' ∇d and its rate, Σ (b'' d' ∇d + b' (∇d)'), over all distances."""

    slopes: Array  # b'
    curvatures: Array  # b''
    gradient: Array  # shape (nv,)
    rate: Array  # shape (nv,)
