"""Draws obstacles, those of a scene or of a log, and the solids of a plant."""

from collections.abc import Iterable, Iterator, Mapping
from itertools import product
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.exceptions import SceneError
from hsp_control.geometry import shapes
from hsp_control.geometry.scene import Scene
from hsp_control.geometry.shapes import Shape, shape_from_log
from hsp_control.simulation.plants.mujoco.mjcf import Solid
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import (
    OBSTACLE,
    OBSTACLE_OPACITY,
    SOLID,
    LegendEntry,
)
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    path_element,
    set_object,
    set_transform,
)
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.robot_drawing import robot_entry
from hsp_control.visualization.viewer.threejs import material, pose_at

_CORNERS = np.array(list(product((-0.5, 0.5), repeat=3)))
_FACES = np.array(
    [
        [0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1],
        [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4], [1, 5, 7], [1, 7, 3],
    ]
)  # fmt: skip


def logged_shape(about: Mapping[str, Any]) -> Shape | None:
    """Return the shape that a log describes, or its bounding ball, or None."""
    try:
        shape = shape_from_log(str(about.get("shape")), about.get("parameters", {}))
        if shape is not None:
            shape.geometry()  # raises if a mesh's file no longer exists
            return shape
    except SceneError:
        pass
    radius = about.get("radius")
    return None if radius is None else shapes.Sphere(float(radius))


def obstacle(shape: Shape, extent: float, color: str = OBSTACLE) -> Json:
    """Return a shape as a three.js object."""
    surface = material(color, opacity=OBSTACLE_OPACITY, glow=0.3)
    pose = np.eye(4)
    match shape:
        case shapes.Sphere():
            solid = threejs.sphere(shape.radius)
        case shapes.Capsule():
            solid = threejs.capsule(shape.length, shape.radius, shape.radius)
            pose = pose_at([0.0, 0.0, -0.5 * shape.length])
        case shapes.Cylinder():
            solid = threejs.cylinder(shape.radius, shape.length)
        case shapes.Box():
            solid = threejs.box(np.asarray(shape.size).tolist())
        case shapes.HalfSpace():
            solid = threejs.plane(extent)
            surface |= {"opacity": 0.3 * OBSTACLE_OPACITY, "side": 2}
        case shapes.PointCloud():
            solid = threejs.facets(*_cubes(np.asarray(shape.points), shape.resolution))
        case _:
            solid = threejs.facets(*triangles_of(shape.geometry()))
            surface |= {"side": 2}
    thing = threejs.mesh(solid, surface, pose)
    thing["object"]["receiveShadow"] = False  # its own would show through
    if isinstance(shape, shapes.HalfSpace):
        thing["object"]["castShadow"] = (
            False  # the drawn square ends, the half-space does not
        )
    return threejs.group([thing])


def _cubes(points: Array, edge: float) -> tuple[Array, Indices]:
    vertices = points[:, None, :] + edge * _CORNERS
    triangles = 8 * np.arange(len(points))[:, None, None] + _FACES
    return vertices.reshape(-1, 3), triangles.reshape(-1, 3)


def triangles_of(geometry: Any) -> tuple[Array, Indices]:
    """Return vertices (n, 3) and triangles (k, 3) of Coal's mesh or convex hull."""
    if isinstance(geometry, coal.BVHModelBase):
        vertices, count, triangle = (
            geometry.vertices(),
            geometry.num_tris,
            geometry.tri_indices,
        )
    else:
        vertices, count, triangle = (
            geometry.points(),
            geometry.num_polygons,
            geometry.polygons,
        )
    indices = [[triangle(k)[i] for i in range(3)] for k in range(count)]
    return np.array(vertices), np.array(indices, dtype=np.int64)


ROOT = "/obstacles"
_TOLD = 3  # number of obstacles that the legend names


def enclosing_corners(shape: Shape, center: Array) -> list[Array]:
    """Return the two corners of the box around a shape; none if it is unbounded."""
    reach = shape.bounding_radius
    if not np.isfinite(reach):
        return []
    return [center - reach, center + reach]


def obstacle_legend(names: Iterable[str], root: str = ROOT) -> list[LegendEntry]:
    """Return the legend of the obstacles: one entry, as all have the same colour."""
    known = list(names)
    if not known:
        return []
    told, more = known[:_TOLD], len(known) - _TOLD
    word = "obstacle" if len(known) == 1 else "obstacles"
    rest = f" and {more} more" if more > 0 else ""
    return [LegendEntry(f"{word} {', '.join(told)}{rest}", OBSTACLE, (root,))]


class ObstacleDrawing:
    """The obstacles of a scene."""

    def __init__(self, scene: Scene) -> None:
        """Store the scene."""
        self._scene = scene

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for item in self._scene.values():
            yield set_object(_path(item.name), obstacle(item.shape, 4.0 * size))

    def move(self, time: float) -> Iterator[Command]:
        """Yield the commands that move the obstacles to a time [s]."""
        for item in self._scene.values():
            placement = item.placement(time).homogeneous
            yield set_transform(_path(item.name), placement)

    def points(self) -> Array:
        """Return no points, shape (0, 3): the viewer knows the robot's."""
        return np.zeros((0, 3))

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles at the start [m], shape (K, 3)."""
        corners = [
            corner
            for item in self._scene.values()
            for corner in enclosing_corners(item.shape, item.placement(0.0).translation)
        ]
        return np.reshape(corners, (-1, 3))

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        return [*obstacle_legend(self._scene), robot_entry()]


def _path(name: str) -> str:
    return f"{ROOT}/{path_element(name)}"


class ObstacleLayer:
    """The obstacles of a log."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Read the log's obstacles."""
        self._root = root
        self._rows = motion.rows
        self.shapes = {
            name: shape
            for name, about in motion.rows.meta.get("obstacles", {}).items()
            if (shape := logged_shape(about)) and f"obstacle.{name}" in motion.rows
        }

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name, shape in self.shapes.items():
            yield set_object(self._path(name), obstacle(shape, 4.0 * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        for name in self.shapes:
            yield from obstacle_tracks(self._path(name), name, motion)

    def points(self) -> Array:
        """Return points that enclose the obstacles in the run [m], shape (K, 3)."""
        clouds = [
            corners
            for name, shape in self.shapes.items()
            for corners in enclosing_corners(shape, self._rows[f"obstacle.{name}"])
        ]
        return np.concatenate([np.zeros((0, 3)), *clouds])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        return obstacle_legend(self.shapes, self._root)

    def _path(self, name: str) -> str:
        return f"{self._root}/{path_element(name)}"


def obstacle_tracks(path: str, name: str, motion: Motion) -> Iterator[Track]:
    """Yield the tracks of a node that follows a logged obstacle."""
    yield Track(path, "position", motion.times, motion.rows[f"obstacle.{name}"])
    turns = f"obstacle.{name}.quaternion"
    if turns in motion.rows:
        yield Track(path, "quaternion", motion.times, motion.rows[turns])


class _Drawn(NamedTuple):
    """A solid, or one of its copies."""

    path: str
    shape: Shape
    placement: pin.SE3  # where it is, or where it starts if it is loose
    column: str  # where the log has its motion: the start of two columns' names


class SolidLayer:
    """The solids of the plant that a log names: fixed ones, and loose ones."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Read the log's plant."""
        self._root, self._rows = root, motion.rows
        solids = solids_of(motion.rows.meta)
        self.names = [solid.name for solid in solids]
        self._drawn = [
            _Drawn(
                f"{root}/{path_element(geom)}",
                solid.shape,
                placed.placement,
                f"plant.solid.{solid.name}" + (f"_{k + 1}" if k else ""),
            )
            for solid in solids
            for k, (geom, placed) in enumerate(solid.geoms())
        ]

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for each in self._drawn:
            yield set_object(each.path, obstacle(each.shape, 4.0 * size, SOLID))
            yield set_transform(each.path, each.placement.homogeneous)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield the tracks of loose solids along the run."""
        for each in self._drawn:
            for what in ("position", "quaternion"):
                if (name := f"{each.column}.{what}") in motion.rows:
                    yield Track(each.path, what, motion.times, motion.rows[name])

    def points(self) -> Array:
        """Return points that enclose them in the run [m], shape (K, 3)."""
        clouds = [np.zeros((0, 3))]
        for each in self._drawn:
            name = f"{each.column}.position"
            moved = name in self._rows
            center = self._rows[name] if moved else each.placement.translation
            corners = enclosing_corners(each.shape, center)
            clouds += [corner.reshape(-1, 3) for corner in corners]
        return np.concatenate(clouds)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entry; none without solids."""
        if not self.names:
            return []
        word = "solid" if len(self.names) == 1 else "solids"
        return [LegendEntry(f"{word} {', '.join(self.names)}", SOLID, (self._root,))]


def solids_of(meta: Mapping[str, Any]) -> list[Solid]:
    """Return the solids of a log's plant."""
    found = []
    for entry in (meta.get("plant") or {}).get("solids", ()):
        given = {key: entry[key] for key in _FIELDS if key in entry}
        shape = dict(given["shape"])
        given["shape"] = shape_from_log(shape.pop("type"), shape)
        found.append(Solid(**given))
    return found


_FIELDS = ("name", "shape", "position", "rotation", "mass", "copies", "spacing")
