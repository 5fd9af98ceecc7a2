"""The geometry of a clearance field: links' shapes, distances, zones of influence."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.analysis import acts, terms_of_type
from hsp_control.companions.plots.palette import COLLISION, OBSTACLE, SERIES, fractions
from hsp_control.companions.viewer import threejs
from hsp_control.companions.viewer.arrows import bar_tracks, unit_bar
from hsp_control.companions.viewer.commands import (
    Json,
    LegendEntry,
    PageCommand,
    page_command,
    path_element,
    set_object,
    set_transform,
    translucent,
)
from hsp_control.companions.viewer.motion import Layer, RunMotion, Track, pose_tracks
from hsp_control.companions.viewer.obstacles import (
    coal_surface,
    obstacle_tracks,
    surface_of,
)
from hsp_control.constraints.limits import MinimumDistance
from hsp_control.control.interface import Controller
from hsp_control.geometry.links import LinkShape
from hsp_control.geometry.scene import Obstacle
from hsp_control.geometry.shapes import HalfSpace, Shape
from hsp_control.null_space.fields import (
    Clearance,
    NullSpaceField,
    ObstacleClearance,
    PointDistance,
)
from hsp_control.robot import RobotState

# -- the shapes of links --------------------------------------------------------------

_MEASURED, _MEASURED_OPACITY = SERIES[4], 0.3


def capsules(controller: Controller, root: str) -> Layer:
    """Draw the links' shapes that are measured, larger than the drawn links."""
    measured = list(_clearances(controller))
    links: dict[int, list[LinkShape]] = {}
    for shape in _measured_shapes(controller, measured):
        links.setdefault(shape.joint, []).append(shape)
    names = controller.robot.model.names
    paths = {joint: f"{root}/{path_element(names[joint])}" for joint in links}

    def draw(_: float) -> Iterator[PageCommand]:
        for joint, own in links.items():
            yield set_object(paths[joint], threejs.group(list(map(_solid, own))))
            if joint == 0:  # the world, which has no track
                yield set_transform(paths[joint], np.eye(4))

    def tracks(motion: RunMotion) -> Iterator[Track]:
        joints = [joint for joint in links if joint]
        poses = motion.joint_poses() if joints else np.zeros(0)
        for joint in joints:
            yield from pose_tracks(paths[joint], motion.times, poses[:, joint])

    def legend() -> list[LegendEntry]:
        kinds = dict.fromkeys(each.proxy for each in measured)
        name = f"{' and '.join(kinds)} of the links (measured)"
        color = translucent(_MEASURED, _MEASURED_OPACITY)
        return [LegendEntry(name, color, (root,))] if links else []

    return Layer(draw, tracks, legend)


def _clearances(controller: Controller) -> Iterator[Clearance]:
    """Yield the clearance fields, and those of the limits on distances."""
    yield from terms_of_type(controller.field, Clearance)  # type: ignore[type-abstract]
    if controller.limits is not None:
        for each in controller.limits.barriers:
            if isinstance(each, MinimumDistance):
                yield each.clearance


def _measured_shapes(
    controller: Controller, measured: list[Clearance]
) -> Iterator[LinkShape]:
    """Yield the shapes of links that are in a pair, once."""
    known = set()
    for clearance in measured:
        proximity = clearance.proximity(controller.state)
        links = proximity.links
        used = sorted({k for pair in proximity.pairs for k in pair if k < len(links)})
        for k in used:
            # By identity: a robot has a single list of shapes per kind.
            if id(links[k]) not in known:
                known.add(id(links[k]))
                yield links[k]


def _solid(shape: LinkShape) -> Json:
    """Return a shape as a three.js object in its joint's frame."""
    surface = threejs.material(_MEASURED, opacity=_MEASURED_OPACITY, glow=0.4)
    solid, pose = coal_surface(shape.geometry)
    pose = shape.placement.homogeneous @ pose
    return threejs.mesh(solid, surface, pose, shadow=False)


# -- distances ------------------------------------------------------------------------

_SELF = "self"
_BAR_RADIUS = 0.003  # radius of a distance bar, over the size of the scene
_END_RADIUS = 0.0075  # radius of the balls at its ends, over the size of the scene
_SURFACES, _CENTERS = "minimum distance", "distance to the obstacle's centre"


class ClosestPoints(NamedTuple):
    """The two closest points, and whether their distance is active in the field."""

    start: Array  # on the robot [m], (3,)
    end: Array  # on the obstacle, or on another link [m], (3,)
    active: bool  # whether their distance is below the field's influence distance
    deep: bool  # whether they overlap: then the distance is a depth


class _Distance(NamedTuple):
    """A distance that a field or a barrier evaluates."""

    kind: str  # its name in the legend
    path: str
    closest: Callable[[RobotState], ClosestPoints]
    obstacle: str = ""  # the obstacle's name, if there is one


def distances(controller: Controller, root: str, color: str) -> Layer:
    """Draw a bar per obstacle, from the closest link, within a field's influence zone.

    Bars are visible through everything: meshes lie inside the capsules that are
    measured. They and the obstacle are red while a link is inside it.
    """
    found = list(_distances(controller, root))
    obstacles = root.removesuffix("/distances") + "/obstacles"

    def draw(size: float) -> Iterator[PageCommand]:
        for _, path, *_ in found:
            surface = threejs.always_visible(threejs.unlit_material(color))
            yield set_object(f"{path}/bar", unit_bar(surface, _BAR_RADIUS * size))
            for end in ("start", "end"):
                ball = threejs.sphere(_END_RADIUS * size)
                thing = threejs.mesh_group(ball, surface, shadow=False)
                yield set_object(f"{path}/{end}", thing)
            yield page_command("length_label", f"{path}/bar", "length label")

    def tracks(motion: RunMotion) -> Iterator[Track]:
        rows = [[each.closest(state) for each in found] for state in motion.states()]
        for each, points in zip(found, zip(*rows, strict=True), strict=True):
            start, end, active, deep = map(np.array, zip(*points, strict=True))
            shown, times = np.asarray(active, float)[:, None], motion.times
            path, red = each.path, fractions(COLLISION)
            yield from bar_tracks(f"{path}/bar", times, start, end)
            yield Track(f"{path}/start", "position", times, start)
            yield Track(f"{path}/end", "position", times, end)
            tint = np.where(deep[:, None], red, fractions(color))
            for part in ("bar", "start", "end"):
                yield Track(f"{path}/{part}", "visible", times, shown)
                yield Track(f"{path}/{part}", "color", times, tint)
            if each.obstacle:
                tint = np.where(deep[:, None], red, fractions(OBSTACLE))
                thing = f"{obstacles}/{path_element(each.obstacle)}"
                yield Track(thing, "color", times, tint)

    def legend() -> list[LegendEntry]:
        paths = {
            kind: tuple(each.path for each in found if each.kind == kind)
            for kind in (_SURFACES, _CENTERS)
        }
        return [LegendEntry(kind, color, own) for kind, own in paths.items() if own]

    return Layer(draw, tracks, legend)


def _distances(controller: Controller, root: str) -> Iterator[_Distance]:
    """Yield the distances that the controller's field and its barriers evaluate."""
    field, drawn = controller.field, set[str]()
    for clearance in _clearances(controller):
        found = _pairs_by_obstacle(clearance, controller.state)
        for name, pairs in found.items():
            if name in drawn:  # the field already shows it
                continue
            path = f"{root}/{path_element(f'{clearance.name} {name}')}"
            closest = partial(_between_pairs, clearance, pairs)
            yield _Distance(_SURFACES, path, closest, "" if name == _SELF else name)
        drawn |= found.keys()
    for term in terms_of_type(field, PointDistance):
        if isinstance(term.obstacle, Obstacle):  # true in a placed field
            path = f"{root}/{path_element(f'{term.name} {term.obstacle.name}')}"
            closest = partial(_to_center, term, term.obstacle)
            yield _Distance(_CENTERS, path, closest)


def _pairs_by_obstacle(clearance: Clearance, state: RobotState) -> dict[str, Array]:
    """Return the indices of the pairs: links and one obstacle, or links and links."""
    proximity = clearance.proximity(state)
    links = len(proximity.links)
    found: dict[str, list[int]] = {}
    for k, (_, second) in enumerate(proximity.pairs):
        name = proximity.obstacles[second - links].name if second >= links else _SELF
        found.setdefault(name, []).append(k)
    return {name: np.array(pairs) for name, pairs in found.items()}


def _between_pairs(
    clearance: Clearance, pairs: Array, state: RobotState
) -> ClosestPoints:
    """Return the closest points of some pairs."""
    proximity = clearance.proximity(state)
    measured = proximity.measure(state)[pairs]
    k = int(np.argmin(measured))
    start, end, _ = proximity.witness(int(pairs[k]))
    # Coal overwrites its points at the next state: copy them.
    active = bool(measured[k] < clearance.influence)
    deep = bool(measured[k] < 0.0)
    return ClosestPoints(np.array(start), np.array(end), active, deep)


def _to_center(
    cost: PointDistance, obstacle: Obstacle, state: RobotState
) -> ClosestPoints:
    """Return the closest frame and an obstacle's centre, always, as in the paper."""
    center = obstacle.center.sample(state.t).position.copy()
    positions = [np.array(state.position(frame)) for frame in cost.frames]
    lengths = [np.linalg.norm(position - center) for position in positions]
    return ClosestPoints(positions[int(np.argmin(lengths))], center, True, False)


# -- zones of influence ---------------------------------------------------------------

_ZONE_OPACITY = 0.06
_SWATCH_OPACITY = 0.35  # in the legend, where the zone's own opacity would be invisible


def influence(field: NullSpaceField, shown: dict[str, Shape], root: str) -> Layer:
    """Draw the zones of shown obstacles in which a clearance field is active."""
    zones: dict[str, tuple[Shape, float]] = {}
    for term in filter(acts, terms_of_type(field, ObstacleClearance)):
        for obstacle in term.obstacles or ():
            if isinstance(obstacle, Obstacle) and obstacle.name in shown:
                known = zones.get(obstacle.name, (obstacle.shape, 0.0))[1]
                zones[obstacle.name] = obstacle.shape, max(known, term.influence)
    paths = {name: f"{root}/{path_element(name)}" for name in zones}

    def draw(size: float) -> Iterator[PageCommand]:
        for name, (shape, reach) in zones.items():
            yield set_object(paths[name], zone(shape, reach, size))

    def tracks(motion: RunMotion) -> Iterator[Track]:
        for name, path in paths.items():
            yield from obstacle_tracks(path, name, motion)

    def legend() -> list[LegendEntry]:
        color = translucent(OBSTACLE, _SWATCH_OPACITY)
        by_reach = {
            reach: tuple(
                paths[name] for name, (_, own) in zones.items() if own == reach
            )
            for reach in sorted({reach for _, reach in zones.values()})
        }
        return [
            LegendEntry(f"influence zone {reach:g} m", color, own)
            for reach, own in by_reach.items()
        ]

    return Layer(draw, tracks, legend)


def zone(shape: Shape, reach: float, size: float) -> Json:
    """Return the surface at a distance [m] from a shape's convex hull, for three.js."""
    surface = threejs.material(OBSTACLE, opacity=_ZONE_OPACITY, glow=0.6)
    if isinstance(shape, HalfSpace):
        surface |= {"side": 2, "opacity": 0.5 * _ZONE_OPACITY}
    else:  # only its back faces are drawn: it never covers the robot
        surface |= {"side": 1}
    solid, pose = surface_of(shape, size, reach)
    return threejs.mesh_group(solid, surface, pose, shadow=False)
