"""The minimum distances that the null-space field evaluates, as labelled bars."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.geometry.scene import Obstacle
from hsp_control.null_space.fields import Clearance, PointDistance
from hsp_control.robot import RobotState
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import BAR_END_RADIUS, BAR_RADIUS
from hsp_control.visualization.viewer.arrows import bar_tracks, unit_bar
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import (
    Command,
    set_length_label,
    set_object,
)
from hsp_control.visualization.viewer.controller_analysis import terms_of_type
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.materials import always_visible, unlit_material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.scene_path import path_element

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
