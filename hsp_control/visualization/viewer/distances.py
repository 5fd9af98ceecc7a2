"""The shortest distances that the null-space field watches, as bars."""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.null_space.fields import Clearance, PointDistance
from hsp_control.robot import RobotState
from hsp_control.visualization.viewer.appearance import BAR_RADIUS
from hsp_control.visualization.viewer.arrows import bar_tracks, unit_bar
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.explained import terms
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.surfaces import paint

_SELF = "self"


class Nearest(NamedTuple):
    """The two points that are nearest, and whether the field sees them.

    Attributes:
        start: On the robot [m], shape (3,).
        end: On the obstacle, or on another link [m], shape (3,).
        seen: Whether their distance is within the field's influence.
    """

    start: Array
    end: Array
    seen: bool


class Distances:
    """One bar for each obstacle, from the link nearest to it, while the field acts."""

    def __init__(self, controller: Controller, root: str, color: str) -> None:
        """Find out what the controller's field watches; draw it in a colour."""
        self._root = root
        self._color = color
        field = controller.field
        self._watches: dict[str, _Pairs | _Frames] = {}
        for clearance in terms(field, Clearance):
            for name, pairs in _by_obstacle(clearance).items():
                self._watches[f"{clearance.name} {name}"] = _Pairs(clearance, pairs)
        for term in terms(field, PointDistance):
            self._watches[f"{term.name} {term.obstacle.name}"] = _Frames(term)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        for name in self._watches:
            bar = unit_bar(paint(self._color), BAR_RADIUS * size)
            yield set_object(self._path(name), bar)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along the run."""
        found: dict[str, list[Nearest]] = {name: [] for name in self._watches}
        for state in motion.states():
            for name, watch in self._watches.items():
                found[name].append(watch.nearest(state))
        for name, rows in found.items():
            start, end, seen = map(np.array, zip(*rows, strict=True))
            yield from bar_tracks(self._path(name), motion.times, start, end, seen)

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        return [("shortest distance", self._color)] if self._watches else []

    def _path(self, name: str) -> str:
        return f"{self._root}/{element(name)}"


class _Pairs:
    """Links and one obstacle, or links among themselves."""

    def __init__(self, clearance: Clearance, pairs: list[int]) -> None:
        self._clearance = clearance
        self._pairs = np.array(pairs)

    def nearest(self, state: RobotState) -> Nearest:
        proximity = self._clearance.proximity
        distances = proximity.measure(state)[self._pairs]
        k = int(np.argmin(distances))
        start, end, _ = proximity.witness(int(self._pairs[k]))
        # Coal's points are its own, and overwritten by the next state's.
        seen = bool(distances[k] < self._clearance.influence)
        return Nearest(np.array(start), np.array(end), seen)


class _Frames:
    """Frames and an obstacle's centre: the paper's own cost, which acts from afar."""

    def __init__(self, cost: PointDistance) -> None:
        self._cost = cost

    def nearest(self, state: RobotState) -> Nearest:
        center = self._cost.obstacle.center.sample(state.t).position.copy()
        places = [np.array(state.position(frame)) for frame in self._cost.frames]
        lengths = [np.linalg.norm(place - center) for place in places]
        return Nearest(places[int(np.argmin(lengths))], center, True)


def _by_obstacle(clearance: Clearance) -> dict[str, list[int]]:
    proximity = clearance.proximity
    links = len(proximity.links)
    found: dict[str, list[int]] = {}
    for k, (_, second) in enumerate(proximity.pairs):
        name = proximity.obstacles[second - links].name if second >= links else _SELF
        found.setdefault(name, []).append(k)
    return found
