"""Draws obstacles, those of a scene or of a log, and the solids of a plant."""

import logging
from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import product
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.errors import SceneError
from hsp_control.companions.plots.palette import MUTED, OBSTACLE, SOLID
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    path_element,
    set_object,
    set_transform,
)
from hsp_control.companions.viewer.motion import Layer, RunMotion, Track
from hsp_control.companions.viewer.robot_drawing import robot_entry
from hsp_control.declaration.rotation import matrix_of
from hsp_control.geometry import shapes
from hsp_control.geometry.enclosing import hull_corners
from hsp_control.geometry.scene import Scene
from hsp_control.geometry.shapes import Shape, shape_from_log
from hsp_control.simulation import Rollout

_log = logging.getLogger(__name__)

ROOT = "/obstacles"
_OPACITY, _WALL, _PALE = 0.75, 0.2, 0.05
_EXTENT = 4.0  # edge of the square that represents a half-space, over the scene's size
_NAMED = 3  # number of obstacles that the legend names

# -- shapes ---------------------------------------------------------------------------

_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def obstacle(
    shape: Shape, size: float, color: str = OBSTACLE, *, upward: float = 1.0
) -> Json:
    """Return a shape as a three.js object, in a scene of a size [m].

    ``upward``: the vertical component of its z axis; a half-space is a floor or a wall.
    """
    surface = threejs.material(color, opacity=_OPACITY, glow=0.3)
    solid, pose = surface_of(shape, size)
    if isinstance(shape, shapes.HalfSpace):  # it must not glare
        wall = abs(upward) < 0.5
        shade, opacity = (color, _WALL) if wall else (MUTED, _PALE)
        surface = threejs.material(shade, opacity=opacity, glow=0.3) | {"side": 2}
    elif solid["type"] == "BufferGeometry" and not isinstance(shape, shapes.PointCloud):
        surface |= {"side": 2}
    thing = threejs.mesh(solid, surface, pose)
    thing["object"]["receiveShadow"] = False  # shadows on it would show through
    # The drawn square is finite, the half-space is not.
    thing["object"]["castShadow"] = not isinstance(shape, shapes.HalfSpace)
    return threejs.group([thing])


def surface_of(shape: Shape, size: float, margin: float = 0.0) -> tuple[Json, Array]:
    """Return the surface at a distance [m] from a shape (its hull), and its pose."""
    if isinstance(shape, shapes.HalfSpace):
        return threejs.plane(_EXTENT * size), threejs.pose_at([0.0, 0.0, margin])
    if isinstance(shape, shapes.PointCloud):
        points = np.asarray(shape.points)
        if margin:
            return _rounded(points, margin), np.eye(4)
        vertices = points[:, None, :] + shape.resolution * _CORNERS
        triangles = 8 * np.arange(len(points))[:, None, None] + _FACES
        cubes = threejs.facets(vertices.reshape(-1, 3), triangles.reshape(-1, 3))
        return cubes, np.eye(4)
    return coal_surface(shape.geometry(), margin)


def coal_surface(geometry: Any, margin: float = 0.0) -> tuple[Json, Array]:
    """Return the surface at a distance [m] from a solid of Coal, and its pose."""
    match geometry:
        case coal.Sphere():
            return threejs.sphere(geometry.radius + margin), np.eye(4)
        case coal.Capsule():
            length, radius = 2.0 * geometry.halfLength, geometry.radius + margin
            return threejs.capsule(length, radius, radius), threejs.pose_at(
                [0.0, 0.0, -0.5 * length]
            )
        case coal.Cylinder():
            radius, length = geometry.radius, 2.0 * geometry.halfLength
            if not margin:
                return threejs.cylinder(radius, length), np.eye(4)
            wide, long = radius + margin, length + 2.0 * margin
            return threejs.rounded_cylinder(wide, long, margin), np.eye(4)
        case coal.Box():
            edges = 2.0 * np.asarray(geometry.halfSide)
            if not margin:
                return threejs.box(edges.tolist()), np.eye(4)
            return _rounded(_CORNERS * edges, margin), np.eye(4)
    vertices, triangles = triangles_of(geometry)
    if margin:
        return _rounded(vertices, margin), np.eye(4)
    return threejs.facets(vertices, triangles), np.eye(4)


def triangles_of(geometry: Any) -> tuple[Array, Indices]:
    """Return vertices (n, 3) and triangles (k, 3) of Coal's mesh or convex hull."""
    if isinstance(geometry, coal.BVHModelBase):
        vertices, triangle = geometry.vertices(), geometry.tri_indices
        count = geometry.num_tris
    else:
        vertices, triangle = geometry.points(), geometry.polygons
        count = geometry.num_polygons
    indices = [[triangle(k)[i] for i in range(3)] for k in range(count)]
    return np.array(vertices), np.array(indices, dtype=np.int64)


def _rounded(points: Array, distance: float) -> Json:
    """Return the convex hull of balls around points; points (K, 3) [m]."""
    from scipy.spatial import ConvexHull  # here: importing SciPy is slow

    cloud = hull_corners(points)[:, None, :] + distance * _unit_sphere()
    hull = ConvexHull(cloud.reshape(-1, 3))
    corners = hull.points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles = hull.simplices.astype(np.int64)
    triangles[inward] = triangles[inward, ::-1]
    return threejs.facets(hull.points, triangles)


def _unit_sphere() -> Array:
    """Return evenly spread points on the unit sphere, shape (200, 3)."""
    k = np.arange(200) + 0.5
    height, turn = 1.0 - k / 100.0, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])


def _enclosing(shape: Shape, centers: Array) -> list[Array]:
    """Return the corners of boxes around a shape, (K, 3); none if it is unbounded."""
    reach, centers = shape.bounding_radius, np.reshape(centers, (-1, 3))
    return [centers - reach, centers + reach] if np.isfinite(reach) else []


# -- a scene, without a run -----------------------------------------------------------


class SceneDrawing:
    """The obstacles of a scene; the robot, whose place it needs, is drawn elsewhere."""

    def __init__(self, scene: Scene, robot: Array) -> None:
        """Store the scene, and points of the robot [m], shape (K, 3)."""
        self._scene, self._robot = scene, robot

    def points(self) -> Array:
        """Return points of the robot [m], shape (K, 3)."""
        return self._robot

    def draw(self, size: float) -> Iterator[PageCommand]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for item in self._scene.values():
            upward = float(item.placement(0.0).rotation[2, 2])
            thing = obstacle(item.shape, size, upward=upward)
            yield set_object(_node(item.name), thing)

    def move(self, time: float) -> Iterator[PageCommand]:
        """Yield the commands that move the obstacles to a time [s]."""
        for item in self._scene.values():
            yield set_transform(_node(item.name), item.placement(time).homogeneous)

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles at the start [m], shape (K, 3)."""
        clouds = [
            corners
            for item in self._scene.values()
            for corners in _enclosing(item.shape, item.placement(0.0).translation)
        ]
        return np.concatenate([np.zeros((0, 3)), *clouds])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        return [*_obstacle_legend(self._scene, ROOT), robot_entry()]


def _node(name: str, root: str = ROOT) -> str:
    return f"{root}/{path_element(name)}"


def _obstacle_legend(names: Iterable[str], root: str) -> list[LegendEntry]:
    """Return the legend of the obstacles: one entry, as all have the same colour."""
    known = list(names)
    if not known:
        return []
    named, more = known[:_NAMED], len(known) - _NAMED
    word = "obstacle" if len(known) == 1 else "obstacles"
    rest = f" and {more} more" if more > 0 else ""
    return [LegendEntry(f"{word} {', '.join(named)}{rest}", OBSTACLE, (root,))]


# -- a log ----------------------------------------------------------------------------


def logged_shapes(rollout: Rollout) -> dict[str, Shape]:
    """Return the obstacles that a log has a shape and a motion of."""
    return {
        name: shape
        for name, about in rollout.meta.get("obstacles", {}).items()
        if (shape := _logged_shape(name, about)) and f"obstacle.{name}" in rollout
    }


def _logged_shape(name: str, about: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or its bounding ball, or None."""
    try:
        shape = shape_from_log(str(about.get("shape")), about.get("parameters", {}))
        if shape is not None:
            shape.geometry()  # raises if a mesh's file no longer exists
            return shape
    except SceneError as error:
        _log.warning("obstacle %s: %s; a ball around it is drawn", name, error)
    radius = about.get("radius")
    return None if radius is None else shapes.Sphere(float(radius))


def obstacle_layer(motion: RunMotion, root: str) -> Layer:
    """Draw the obstacles of a log, in motion."""
    known = logged_shapes(motion.rows)

    def draw(size: float) -> Iterator[PageCommand]:
        for name, shape in known.items():
            thing = obstacle(shape, size, upward=_upward(name, motion))
            yield set_object(_node(name, root), thing)

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for name in known:
            yield from obstacle_tracks(_node(name, root), name, motion)

    return Layer(draw, tracks, lambda: _obstacle_legend(known, root))


def _upward(name: str, motion: RunMotion) -> float:
    """Return the vertical component of an obstacle's z axis at the first row."""
    turns = f"obstacle.{name}.quaternion"
    if turns not in motion.rows:
        return 1.0
    x, y, _, _ = motion.rows[turns][0]
    return float(1.0 - 2.0 * (x * x + y * y))


def obstacle_tracks(path: str, name: str, motion: RunMotion) -> Iterator[Track]:
    """Yield the tracks of a node that follows a logged obstacle."""
    yield Track(path, "position", motion.times, motion.rows[f"obstacle.{name}"])
    turns = f"obstacle.{name}.quaternion"
    if turns in motion.rows:
        yield Track(path, "quaternion", motion.times, motion.rows[turns])


class _DrawnSolid(NamedTuple):
    """A solid, or one of its copies."""

    name: str  # of its node
    shape: Shape
    placement: pin.SE3  # its pose, or its initial pose if it is loose
    column: str  # where the log has its motion: the start of two columns' names


def solid_layer(motion: RunMotion, root: str) -> Layer:
    """Draw the solids of the plant that a log names: fixed ones, and loose ones."""
    solids = _logged_solids(motion.rows)

    def draw(size: float) -> Iterator[PageCommand]:
        for each in solids:
            path = _node(each.name, root)
            upward = float(each.placement.rotation[2, 2])
            thing = obstacle(each.shape, size, SOLID, upward=upward)
            yield set_object(path, thing)
            yield set_transform(path, each.placement.homogeneous)

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for each in solids:
            for what in ("position", "quaternion"):
                if (name := f"{each.column}.{what}") in motion.rows:
                    rows = motion.rows[name]
                    yield Track(_node(each.name, root), what, motion.times, rows)

    def legend() -> list[LegendEntry]:
        names = [solid["name"] for solid in _solids(motion.rows.meta)]
        word = "solid" if len(names) == 1 else "solids"
        entry = LegendEntry(f"{word} {', '.join(names)}", SOLID, (root,))
        return [entry] if names else []

    return Layer(draw, tracks, legend)


def _logged_solids(rollout: Rollout) -> list[_DrawnSolid]:
    found = []
    for solid in _solids(rollout.meta):
        name, kind = solid["name"], dict(solid["shape"])
        shape = shape_from_log(kind.pop("type"), kind)
        place, step = (np.array(solid.get(k, _ZERO)) for k in ("position", "spacing"))
        rotation = matrix_of(solid.get("rotation", _ZERO))
        assert shape is not None  # all shapes of solids are known
        for k in range(solid.get("copies", 1)):
            column = f"plant.solid.{name}" + (f"_{k + 1}" if k else "")
            placed = pin.SE3(rotation, place + k * step)
            found.append(_DrawnSolid(f"solid/{name}/{k}", shape, placed, column))
    return found


_ZERO = (0.0, 0.0, 0.0)


def _solids(meta: Mapping[str, Any]) -> Sequence[Mapping[str, Any]]:
    """Return the solids of the plant that a log was made with."""
    return tuple((meta.get("plant") or {}).get("solids", ()))


def points_around(rollout: Rollout) -> Array:
    """Return points that enclose obstacles and solids in a run [m], (K, 3)."""
    clouds = [np.zeros((0, 3))]
    for name, shape in logged_shapes(rollout).items():
        clouds += _enclosing(shape, rollout[f"obstacle.{name}"])
    for each in _logged_solids(rollout):
        moved = rollout.columns.get(f"{each.column}.position")
        still = each.placement.translation
        clouds += _enclosing(each.shape, still if moved is None else moved)
    return np.concatenate(clouds)
