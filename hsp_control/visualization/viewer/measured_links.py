"""What a clearance field measures: links' shapes, distances, zones of influence."""

from collections.abc import Iterator
from itertools import product
from typing import Any, NamedTuple

import coal
import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.geometry import shapes
from hsp_control.geometry.enclosing import hull_corners
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import Shape
from hsp_control.null_space.fields import Clearance, ObstacleClearance, PointDistance
from hsp_control.robot import RobotState
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import (
    BAR_END_RADIUS,
    BAR_RADIUS,
    MEASURED,
    MEASURED_OPACITY,
    OBSTACLE,
    ZONE_OPACITY,
    LegendEntry,
    translucent,
)
from hsp_control.visualization.viewer.arrows import bar_tracks, unit_bar
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    path_element,
    set_length_label,
    set_object,
    set_transform,
)
from hsp_control.visualization.viewer.controller_analysis import terms_of_type
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacle_layer import obstacle_tracks
from hsp_control.visualization.viewer.obstacle_shapes import facets, triangles_of
from hsp_control.visualization.viewer.threejs import (
    always_visible,
    material,
    pose_at,
    unlit_material,
)


class Capsules:
    """The links' shapes that the controller measures, larger than the drawn links."""

    def __init__(self, controller: Controller, root: str) -> None:
        """Find the links that are measured."""
        self._root = root
        self._names = list(controller.robot.model.names)
        measured = list(_clearances(controller))
        self._kinds = dict.fromkeys(each.proxy for each in measured)
        self._links: dict[int, list[LinkShape]] = {}
        for shape in _measured_shapes(controller, measured):
            self._links.setdefault(shape.joint, []).append(shape)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for joint, links in self._links.items():
            solids = [_solid(shape) for shape in links]
            yield set_object(self._path(joint), threejs.group(solids))
            if joint == 0:  # the world, which has no track
                yield set_transform(self._path(joint), np.eye(4))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        joints = [joint for joint in self._links if joint]
        if not joints:
            return
        poses = np.array(
            [
                [pin.SE3ToXYZQUAT(state.data.oMi[joint]) for joint in joints]
                for state in motion.states()
            ]
        )
        for k, joint in enumerate(joints):
            path = self._path(joint)
            yield Track(path, "position", motion.times, poses[:, k, :3])
            yield Track(path, "quaternion", motion.times, poses[:, k, 3:])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        if not self._links:
            return []
        name = f"{' and '.join(self._kinds)} of the links (measured)"
        color = translucent(MEASURED, MEASURED_OPACITY)
        return [LegendEntry(name, color, (self._root,))]

    def _path(self, joint: int) -> str:
        return f"{self._root}/{path_element(self._names[joint])}"


def _clearances(controller: Controller) -> Iterator[Clearance]:
    """Yield the clearance fields, and those of the limits on distances."""
    yield from terms_of_type(controller.field, Clearance)  # type: ignore[type-abstract]
    if controller.limits is not None:
        yield from (each.clearance for each in controller.limits.distances)


def _measured_shapes(
    controller: Controller, measured: list[Clearance]
) -> Iterator[LinkShape]:
    """Yield each shape of a link that is in a pair, once."""
    known = set()
    for clearance in measured:
        proximity = clearance.proximity(controller.state)
        links = proximity.links
        used = sorted({k for pair in proximity.pairs for k in pair if k < len(links)})
        for k in used:
            # By identity: a robot has one list of shapes of each kind.
            if id(links[k]) not in known:
                known.add(id(links[k]))
                yield links[k]


def _solid(shape: LinkShape) -> Json:
    """Return a shape as a three.js object in its joint's frame."""
    surface = material(MEASURED, opacity=MEASURED_OPACITY, glow=0.4)
    pose, geometry = shape.placement.homogeneous, shape.geometry
    match geometry:
        case coal.Sphere():
            solid = threejs.sphere(geometry.radius)
        case coal.Capsule():
            length, radius = 2.0 * geometry.halfLength, geometry.radius
            solid = threejs.capsule(length, radius, radius)
            pose = pose @ pose_at([0.0, 0.0, -0.5 * length])
        case coal.Cylinder():
            solid = threejs.cylinder(geometry.radius, 2.0 * geometry.halfLength)
        case coal.Box():
            solid = threejs.box((2.0 * np.asarray(geometry.halfSide)).tolist())
        case _:
            solid = facets(*triangles_of(geometry))
    return threejs.mesh(solid, surface, pose, shadow=False)


_SELF = "self"
_ENDS = ("start", "end")


class ClosestPoints(NamedTuple):
    """The two closest points, and whether their distance is active in the field."""

    start: Array  # on the robot [m], (3,)
    end: Array  # on the obstacle, or on another link [m], (3,)
    active: bool  # whether their distance is below the field's influence distance


class Distances:
    """One bar per obstacle, from the closest link, while the field is active there.

    Bars are seen through all else: meshes lie inside the capsules that are measured.
    """

    def __init__(self, controller: Controller, root: str, color: str) -> None:
        """Find the distances that the controller's field evaluates."""
        self._root = root
        self._color = color
        field = controller.field
        self._distances: dict[str, _PairDistance | _FrameDistance] = {}
        for clearance in terms_of_type(field, Clearance):  # type: ignore[type-abstract]
            for name, pairs in _by_obstacle(clearance, controller.state).items():
                self._distances[f"{clearance.name} {name}"] = _PairDistance(
                    clearance, pairs
                )
        for term in terms_of_type(field, PointDistance):
            if isinstance(term.obstacle, Obstacle):  # in a placed field it is
                name = f"{term.name} {term.obstacle.name}"
                self._distances[name] = _FrameDistance(term, term.obstacle)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name in self._distances:
            surface = always_visible(unlit_material(self._color))
            bar = unit_bar(surface, BAR_RADIUS * size)
            yield set_object(self._path(name, "bar"), bar)
            ball = threejs.sphere(BAR_END_RADIUS * size)
            for end in _ENDS:
                thing = threejs.group([threejs.mesh(ball, surface, shadow=False)])
                yield set_object(self._path(name, end), thing)
            yield set_length_label(self._path(name, "bar"))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        found: dict[str, list[ClosestPoints]] = {name: [] for name in self._distances}
        for state in motion.states():
            for name, distance in self._distances.items():
                found[name].append(distance.closest_points(state))
        for name, rows in found.items():
            start, end, active = map(np.array, zip(*rows, strict=True))
            times, bar = motion.times, self._path(name, "bar")
            yield from bar_tracks(bar, times, start, end, active)
            shown = np.asarray(active, float)[:, None]
            for place, points in zip(_ENDS, (start, end), strict=True):
                path = self._path(name, place)
                yield Track(path, "position", times, points)
                yield Track(path, "visible", times, shown)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        kinds = {
            "minimum distance": _PairDistance,
            "distance to the obstacle's centre": _FrameDistance,
        }
        return [
            LegendEntry(name, self._color, paths)
            for name, kind in kinds.items()
            if (
                paths := tuple(
                    f"{self._root}/{path_element(key)}"
                    for key, distance in self._distances.items()
                    if isinstance(distance, kind)
                )
            )
        ]

    def _path(self, name: str, part: str) -> str:
        return f"{self._root}/{path_element(name)}/{part}"


class _PairDistance:
    """The minimum distance of pairs: links and one obstacle, or links and links."""

    def __init__(self, clearance: Clearance, pairs: list[int]) -> None:
        self._clearance = clearance
        self._pairs = np.array(pairs)

    def closest_points(self, state: RobotState) -> ClosestPoints:
        proximity = self._clearance.proximity(state)
        distances = proximity.measure(state)[self._pairs]
        k = int(np.argmin(distances))
        start, end, _ = proximity.witness(int(self._pairs[k]))
        # Coal overwrites its points at the next state: copy them.
        active = bool(distances[k] < self._clearance.influence)
        return ClosestPoints(np.array(start), np.array(end), active)


class _FrameDistance:
    """The distance of frames to an obstacle's centre: the paper's cost, always on."""

    def __init__(self, cost: PointDistance, obstacle: Obstacle) -> None:
        self._cost, self._obstacle = cost, obstacle

    def closest_points(self, state: RobotState) -> ClosestPoints:
        center = self._obstacle.center.sample(state.t).position.copy()
        positions = [np.array(state.position(frame)) for frame in self._cost.frames]
        lengths = [np.linalg.norm(position - center) for position in positions]
        return ClosestPoints(positions[int(np.argmin(lengths))], center, True)


def _by_obstacle(clearance: Clearance, state: RobotState) -> dict[str, list[int]]:
    proximity = clearance.proximity(state)
    links = len(proximity.links)
    found: dict[str, list[int]] = {}
    for k, (_, second) in enumerate(proximity.pairs):
        name = proximity.obstacles[second - links].name if second >= links else _SELF
        found.setdefault(name, []).append(k)
    return found


_SWATCH_OPACITY = 0.35
"""Opacity of its colour in the legend: as pale as the zone would be invisible."""


class Influence:
    """The zone of influence of each obstacle of a clearance field."""

    def __init__(self, field: Any, shown: dict[str, Shape], root: str) -> None:
        """Find the zones of influence."""
        self._root = root
        self._zones: dict[str, tuple[Shape, float]] = {}
        for term in terms_of_type(field, ObstacleClearance):
            for obstacle in term.obstacles or ():
                if isinstance(obstacle, Obstacle) and obstacle.name in shown:
                    name, shape = obstacle.name, obstacle.shape
                    known = self._zones.get(name, (shape, 0.0))[1]
                    self._zones[name] = shape, max(known, term.influence)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name, (shape, influence) in self._zones.items():
            yield set_object(self._path(name), zone(shape, influence, 4.0 * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        for name in self._zones:
            yield from obstacle_tracks(self._path(name), name, motion)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries: one for each distance at which a zone begins."""
        reaches = sorted({reach for _, reach in self._zones.values()})
        color = translucent(OBSTACLE, _SWATCH_OPACITY)
        return [
            LegendEntry(
                f"influence zone {reach:g} m",
                color,
                tuple(
                    self._path(name)
                    for name, (_, own) in self._zones.items()
                    if own == reach
                ),
            )
            for reach in reaches
        ]

    def _path(self, name: str) -> str:
        return f"{self._root}/{path_element(name)}"


def zone(shape: Shape, influence: float, extent: float) -> Json:
    """Return the surface at a distance [m] from a shape's convex hull, for three.js."""
    # Only its back faces are drawn: it never covers the robot.
    surface = material(OBSTACLE, opacity=ZONE_OPACITY, glow=0.6) | {"side": 1}
    pose = np.eye(4)
    match shape:
        case shapes.Sphere():
            solid = threejs.sphere(shape.radius + influence)
        case shapes.Capsule():
            radius = shape.radius + influence
            solid = threejs.capsule(shape.length, radius, radius)
            pose = pose_at([0.0, 0.0, -0.5 * shape.length])
        case shapes.Cylinder():
            solid = threejs.rounded_cylinder(
                shape.radius + influence, shape.length + 2.0 * influence, influence
            )
        case shapes.HalfSpace():
            solid = threejs.plane(extent)
            pose = pose_at([0.0, 0.0, influence])
            surface |= {"side": 2, "opacity": 0.5 * ZONE_OPACITY}
        case shapes.Box():
            corners = np.array(list(product((-0.5, 0.5), repeat=3)))
            solid = _rounded(corners * np.asarray(shape.size), influence)
        case shapes.PointCloud():
            solid = _rounded(np.asarray(shape.points), influence)
        case _:
            solid = _rounded(triangles_of(shape.geometry())[0], influence)
    return threejs.group([threejs.mesh(solid, surface, pose, shadow=False)])


def _rounded(points: Array, distance: float) -> Json:
    """Return the convex hull of balls around points; points (K, 3) [m]."""
    from scipy.spatial import ConvexHull  # here: SciPy takes long to import

    cloud = (hull_corners(points)[:, None, :] + distance * _unit_sphere()).reshape(
        -1, 3
    )
    hull = ConvexHull(cloud)
    corners = hull.points[hull.simplices]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inward = (normals * hull.equations[:, :3]).sum(axis=1) < 0.0
    triangles = hull.simplices.astype(np.int64)
    triangles[inward] = triangles[inward, ::-1]
    return facets(hull.points, triangles)


def _unit_sphere() -> Array:
    """Return evenly spread points on the unit sphere, shape (200, 3)."""
    k = np.arange(200) + 0.5
    height, turn = 1.0 - k / 100.0, np.pi * (1.0 + np.sqrt(5.0)) * k
    ring = np.sqrt(1.0 - height**2)
    return np.column_stack([ring * np.cos(turn), ring * np.sin(turn), height])
