"""Distances in closed form, with the exact rate of their gradients, as kernels.

A link is a sphere or a capsule: all points within a radius of a segment, its core. The
other shape is such a link, an obstacle that is a sphere or a capsule, or, if the link
is a sphere, a solid (box, cylinder or half-space).

With x and y the nearest points of the two cores and n = (x - y)/|x - y|,

    ∇d = J_xᵀ n - J_yᵀ n,    d' = n · (x' - y'),

where x' and y' include the motion of the nearest points along their cores. A column
(l, w) of a joint's Jacobian at the world's origin contributes l·n + w·(x × n) to the
gradient; the product rule gives its rate.
"""

from collections.abc import Sequence
from typing import NamedTuple

import coal
import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import KernelCall, KernelCalls, kernel
from hsp_control.compiled.rotations import cross, rotate, rotate_back
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import Box, Capsule, Cylinder, HalfSpace, Shape, Sphere
from hsp_control.geometry.signed_distance import (
    BOX,
    CYLINDER,
    HALF_SPACE,
    SEGMENT,
    direction,
    distance_to_solid,
    nearest_on_segments,
    nearest_rates,
)
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.kinematics import WorldKinematics, joint_support

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
        self._moving: KernelCalls = [
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
        zeros = np.zeros((3, 3)), np.zeros((3, 3)), np.zeros((4, 3)), np.zeros((5, 3))
        self._nearest = _Nearest(*zeros)
        self._distances = distances
        sums = np.zeros((2, len(distances))), np.zeros((2, robot.nv))
        self._sums = _Sums(*sums[0], *sums[1])
        # bodies, place and core of each pair; then those of segments, and with solids
        self._pairs = np.column_stack([pairs, places, np.arange(len(pairs))])
        solid = self._kinds[pairs[:, 1], 0] != SEGMENT
        self._of_segments, self._of_solids = self._pairs[~solid], self._pairs[solid]
        # number of calls of `measure`, at any state, shape (1,)
        self.measurements: Indices = np.zeros(1, dtype=np.int64)

    def measure(self, state: RobotState) -> None:
        """Write the distances [m]."""
        calls = state.cached(self, "distances", lambda: state.plan(self.calls(state)))
        calls.run(state.t)

    def calls(self, state: RobotState) -> KernelCalls:
        """Return the calls of `measure` for this state."""
        placements, bodies = state.world.placements, self  # see `supplied`
        given = self.measurements, placements, bodies, self._used, self._of_segments
        work = self._segments, self._cores, self._distances
        calls: list[KernelCall] = [(_measure, (*given, *work))]
        if len(self._of_solids):  # who has none does not compile it
            solids = self._bodies, self._of_solids, self._nearest.work
            calls.append((_measure_solids, (*solids, *work)))
        return calls

    def supplied(self) -> "tuple[_Bodies, KernelCalls]":
        """Return the bodies as a kernel reads them, and the calls that move them."""
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
        overwrites what is returned.
        """
        sums = self._sums
        run = state.cached(
            self,
            "derivatives",
            lambda: state.plan(self.derivatives(state, *sums)).call(),
        )
        sums.slopes[:], sums.curvatures[:] = slopes, curvatures
        run()
        return sums.gradient, sums.rate

    def derivatives(self, state: RobotState, *sums: Array) -> KernelCalls:
        """Return the calls of `differentiate` for these arguments."""
        work = self._segments, self._nearest, _Sums(*sums)
        given = state.world, self._bodies
        calls: list[KernelCall] = [(_differentiate, (*given, self._of_segments, *work))]
        if len(self._of_solids):
            calls.append((_differentiate_solids, (*given, self._of_solids, *work)))
        return calls


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


class _Nearest(NamedTuple):
    """Two bodies and their nearest points, of one pair after the other."""

    core: Array  # the points x and y, and n, shape (3, 3)
    core_dot: Array  # their rates, shape (3, 3)
    # twists of both bodies at the world's origin: v, ω, v, ω, shape (4, 3)
    twists: Array
    work: Array  # scratch, shape (5, 3)


class _Sums(NamedTuple):
    """Σ b' ∇d and its rate, Σ (b'' d' ∇d + b' (∇d)'), over all distances."""

    slopes: Array  # b'
    curvatures: Array  # b''
    gradient: Array  # shape (nv,)
    rate: Array  # shape (nv,)


@kernel
def _measure(
    measurements: Indices,
    placements: Array,
    bodies: _Bodies,
    used: Indices,
    pairs: Indices,
    segments: Array,
    cores: Array,
    distances: Array,
) -> None:
    """Write the segments in the world, and the distance and (x, y, n) of each pair."""
    measurements[0] += 1
    kinds, sizes, motion = bodies.kinds, bodies.sizes, bodies.motion
    for k in range(used.shape[0]):
        i = used[k]
        _place(placements, motion, sizes, i, kinds[i, 1], segments)
    for k in range(pairs.shape[0]):
        i, j, core = pairs[k, 0], pairs[k, 1], cores[pairs[k, 3]]
        s, t, _, _ = nearest_on_segments(segments, i, j)
        for a in range(3):
            core[0, a] = segments[i, 0, a] + s * segments[i, 1, a]
            core[1, a] = segments[j, 0, a] + t * segments[j, 1, a]
        distances[pairs[k, 2]] = direction(core) - sizes[i, 6] - sizes[j, 6]


@kernel
def _measure_solids(
    bodies: _Bodies,
    pairs: Indices,
    work: Array,
    segments: Array,
    cores: Array,
    distances: Array,
) -> None:
    """Write the distance and (x, y, n) of each sphere to a solid, after `_measure`."""
    kinds, sizes, motion = bodies.kinds, bodies.sizes, bodies.motion
    local, H = work[0], work[1:4]
    for k in range(pairs.shape[0]):
        i, j, core = pairs[k, 0], pairs[k, 1], cores[pairs[k, 3]]
        x, n, moving = segments[i, 0], core[2], motion[-1 - kinds[j, 1]]
        distance = _to_solid(kinds[j, 0], sizes[j], moving, x, local, H, n)
        for a in range(3):
            core[0, a] = x[a]
            core[1, a] = x[a] - distance * n[a]
        distances[pairs[k, 2]] = distance - sizes[i, 6]


@kernel
def _place(
    placements: Array, motion: Array, sizes: Array, i: int, joint: int, segments: Array
) -> None:
    """Write a segment's start and axis in the world; the axis of a sphere is zero."""
    for a in range(3):
        start = axis = 0.0
        if joint >= 0:  # Pinocchio stores rotations column by column
            for b in range(3):
                start += placements[joint, 3 * b + a] * sizes[i, b]
                axis += placements[joint, 3 * b + a] * sizes[i, 3 + b]
            start += placements[joint, 9 + a]
        else:
            for b in range(3):
                start += motion[-1 - joint, 3 * a + b] * sizes[i, b]
                axis += motion[-1 - joint, 3 * a + b] * sizes[i, 3 + b]
            start += motion[-1 - joint, 9 + a]
        segments[i, 0, a] = start
        segments[i, 1, a] = axis


@kernel
def _to_solid(
    kind: int, size: Array, motion: Array, x: Array, local: Array, H: Array, n: Array
) -> float:
    """Return the distance of a point in the world to a solid, and write the normal."""
    R = motion[:9].reshape(3, 3)
    for a in range(3):
        local[a] = x[a] - motion[9 + a]
    rotate_back(R, local, local)
    distance = distance_to_solid(kind, size, local, n, H)
    rotate(R, n, n)
    return distance


@kernel
def _differentiate(
    world: WorldKinematics,
    bodies: _Bodies,
    pairs: Indices,
    segments: Array,
    nearest: _Nearest,
    sums: _Sums,
) -> None:
    """Write the sums of pairs of segments."""
    for p in range(sums.gradient.shape[0]):
        sums.gradient[p] = sums.rate[p] = 0.0
    for k in range(pairs.shape[0]):
        if _counts(world, bodies, pairs[k], nearest, sums):
            _between_segments(segments, pairs[k, 0], pairs[k, 1], nearest)
            _add_pair(world, bodies, pairs[k], nearest, sums)


@kernel
def _differentiate_solids(
    world: WorldKinematics,
    bodies: _Bodies,
    pairs: Indices,
    segments: Array,
    nearest: _Nearest,
    sums: _Sums,
) -> None:
    """Add the sums of spheres and solids, after `_differentiate`."""
    for k in range(pairs.shape[0]):
        if _counts(world, bodies, pairs[k], nearest, sums):
            center, j = segments[pairs[k, 0], 0], pairs[k, 1]
            _to_moving_solid(center, bodies, j, nearest)
            _add_pair(world, bodies, pairs[k], nearest, sums)


@kernel
def _counts(
    world: WorldKinematics,
    bodies: _Bodies,
    pair: Indices,
    nearest: _Nearest,
    sums: _Sums,
) -> bool:
    """Return whether b' or b'' of a pair is not zero; then write both twists."""
    counts = sums.slopes[pair[2]] != 0.0 or sums.curvatures[pair[2]] != 0.0
    if counts:
        _twist(world, bodies, pair[0], nearest.twists[:2])
        _twist(world, bodies, pair[1], nearest.twists[2:])
    return bool(counts)


@kernel
def _add_pair(
    world: WorldKinematics,
    bodies: _Bodies,
    pair: Indices,
    nearest: _Nearest,
    sums: _Sums,
) -> None:
    """Add b' ∇d of a pair and its rate."""
    slope, curvature = sums.slopes[pair[2]], sums.curvatures[pair[2]]
    n, n_dot = nearest.core[2], nearest.core_dot[2]
    d_dot = 0.0
    for a in range(3):
        d_dot += n[a] * (nearest.core_dot[0, a] - nearest.core_dot[1, a])
    # The force b' n and its rate on the first body; the opposite on the second.
    for a in range(3):
        n_dot[a] = slope * n_dot[a] + curvature * d_dot * n[a]
        n[a] *= slope
    _add_force(world, bodies, pair[0], nearest, 0, sums)
    if bodies.kinds[pair[1], 1] >= 0:
        for a in range(3):
            n[a], n_dot[a] = -n[a], -n_dot[a]
        _add_force(world, bodies, pair[1], nearest, 1, sums)


@kernel
def _twist(world: WorldKinematics, bodies: _Bodies, i: int, twist: Array) -> None:
    """Write a body's twist at the world's origin: linear velocity, angular velocity."""
    J, v, kinds, motion = world.jacobian, world.v, bodies.kinds, bodies.motion
    columns, dofs = bodies.columns, bodies.dofs
    for a in range(3):
        twist[0, a] = twist[1, a] = 0.0
    for p in range(kinds[i, 2], kinds[i, 3]):
        for a in range(3):
            twist[0, a] += J[a, columns[p]] * v[dofs[p]]
            twist[1, a] += J[3 + a, columns[p]] * v[dofs[p]]
    if kinds[i, 1] < 0:
        own = motion[-1 - kinds[i, 1]]
        for a in range(3):
            twist[1, a] = own[15 + a]
        cross(own[9:12], twist[1], twist[0])
        for a in range(3):
            twist[0, a] += own[12 + a]


@kernel
def _velocity(twist: Array, x: Array, out: Array) -> None:
    """Write the velocity of the point of a body that is at x."""
    cross(twist[1], x, out)
    for a in range(3):
        out[a] += twist[0, a]


@kernel
def _between_segments(segments: Array, i: int, j: int, nearest: _Nearest) -> None:
    """Write the nearest points x and y and the normal n, with their rates."""
    core, core_dot, twists, work = nearest
    a, e, b, f = segments[i, 0], segments[i, 1], segments[j, 0], segments[j, 1]
    a_dot, e_dot, b_dot, f_dot = work[0], work[1], work[2], work[3]
    _velocity(twists[:2], a, a_dot)
    _velocity(twists[2:], b, b_dot)
    cross(twists[1], e, e_dot)
    cross(twists[3], f, f_dot)
    s, t, s_free, t_free = nearest_on_segments(segments, i, j)
    s_dot, t_dot = nearest_rates(
        a, a_dot, e, e_dot, b, b_dot, f, f_dot, s, t, s_free, t_free
    )
    for c in range(3):
        core[0, c] = a[c] + s * e[c]
        core[1, c] = b[c] + t * f[c]
        core_dot[0, c] = a_dot[c] + s * e_dot[c] + s_dot * e[c]
        core_dot[1, c] = b_dot[c] + t * f_dot[c] + t_dot * f[c]
        core_dot[2, c] = 0.0
    distance = direction(core)
    if distance > 0.0:
        along = 0.0
        for c in range(3):
            along += core[2, c] * (core_dot[0, c] - core_dot[1, c])
        for c in range(3):
            change = core_dot[0, c] - core_dot[1, c] - along * core[2, c]
            core_dot[2, c] = change / distance


@kernel
def _to_moving_solid(center: Array, bodies: _Bodies, j: int, nearest: _Nearest) -> None:
    """Write the sphere's centre x, x', y', the normal n and n'.

    In the solid's axes the normal is the gradient of the distance at the point, so that
    n' = ω × n + R H Rᵀ(x' - y'), where y' is the velocity of the solid's point at x.
    """
    core, core_dot, twists, work = nearest
    local, n_change, H = work[0], work[1], work[2:5]
    n, x_dot, y_dot, n_dot = core[2], core_dot[0], core_dot[1], core_dot[2]
    kind, motion = bodies.kinds[j, 0], bodies.motion[-1 - bodies.kinds[j, 1]]
    _to_solid(kind, bodies.sizes[j], motion, center, local, H, n)
    _velocity(twists[:2], center, x_dot)
    _velocity(twists[2:], center, y_dot)
    R = motion[:9].reshape(3, 3)
    for a in range(3):
        core[0, a] = center[a]
        local[a] = x_dot[a] - y_dot[a]
    rotate_back(R, local, local)
    rotate(H, local, n_change)
    rotate(R, n_change, n_change)
    cross(twists[3], n, n_dot)
    for a in range(3):
        n_dot[a] += n_change[a]


@kernel
def _add_force(
    world: WorldKinematics,
    bodies: _Bodies,
    i: int,
    nearest: _Nearest,
    which: int,
    sums: _Sums,
) -> None:
    """Add J(x)ᵀ n and its rate, x the first point or the second, where body i is.

    J is the linear Jacobian of a point of a link.
    """
    J, J_dot, work = world.jacobian, world.jacobian_dot, nearest.work
    x, x_dot = nearest.core[which], nearest.core_dot[which]
    force, force_dot = nearest.core[2], nearest.core_dot[2]
    kinds, columns, dofs = bodies.kinds, bodies.columns, bodies.dofs
    moment, moment_dot, turned = work[0], work[1], work[2]
    cross(x, force, moment)
    cross(x_dot, force, moment_dot)
    cross(x, force_dot, turned)
    for a in range(3):
        moment_dot[a] += turned[a]
    for p in range(kinds[i, 2], kinds[i, 3]):
        c = columns[p]
        change = change_dot = 0.0
        for a in range(3):
            change += J[a, c] * force[a] + J[3 + a, c] * moment[a]
            change_dot += J_dot[a, c] * force[a] + J_dot[3 + a, c] * moment[a]
            change_dot += J[a, c] * force_dot[a] + J[3 + a, c] * moment_dot[a]
        sums.gradient[dofs[p]] += change
        sums.rate[dofs[p]] += change_dot
