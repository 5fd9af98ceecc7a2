"""Where tasks wanted the robot and where it was, as trails in space."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.appearance import (
    ACTUAL,
    DESIRED,
    DESIRED_WIDENING,
    GHOST_NARROWING,
    PATH_RADIUS,
)
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, extend_trail, set_trail
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.surfaces import color_number
from hsp_control.visualization.viewer.targets import read_targets

_MOST_RINGS = 1500


class Paths:
    """The desired path as a sleeve, the actual one within it, as far as it has come."""

    def __init__(
        self, motion: Motion, root: str, color: str = ACTUAL, *, ghost: bool = False
    ) -> None:
        """Read where the tasks' points were and should have been.

        Args:
            motion: The run.
            root: The layer's node.
            color: The actual path's.
            ghost: Draw the actual path alone, within another's if they are the same.
        """
        self._root = root
        self._color = color
        self._ghost = ghost
        self._still = PATH_RADIUS * motion.size
        rows = _ring_rows(len(motion.times))
        self._ring_times = motion.times[rows]
        self._paths = {
            target.name: (target.desired[rows], target.actual[rows])
            for target in read_targets(motion.rows)
            if target.desired is not None
        }

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        radius = PATH_RADIUS * size
        slender = GHOST_NARROWING if self._ghost else 1.0
        actual, desired = color_number(self._color), color_number(DESIRED)
        for name, (wanted, was) in self._paths.items():
            # Where it stands still, the target shows where.
            if not self._ghost and self._leads_away(wanted):
                wide = DESIRED_WIDENING * radius
                path = self._path(name, "desired")
                yield set_trail(path, wanted, wide, desired, sleeve=True)
            if self._leads_away(was):
                path = self._path(name, "actual")
                yield set_trail(path, was, slender * radius, actual)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along the run."""
        del motion  # a trail knows its own rings' times
        rings = np.arange(len(self._ring_times), dtype=float)[:, None]
        for name in self._paths:
            path = self._path(name, "actual")
            yield Track(path, "length", self._ring_times, rings)

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        paths = self._paths.values()
        if not any(self._leads_away(wanted) for wanted, _ in paths):
            return []
        return [("desired path", DESIRED), ("actual path", self._color)]

    def points(self) -> Array:
        """Return points of the desired paths [m], shape (K, 3)."""
        wanted = [desired for desired, _ in self._paths.values()]
        return np.concatenate([np.zeros((0, 3)), *wanted])

    def _leads_away(self, path: Array) -> bool:
        """Return whether a path is one, and not the point where something rests."""
        return bool(len(path) and np.ptp(path, axis=0).max() >= self._still)

    def _path(self, name: str, kind: str) -> str:
        return f"{self._root}/{element(name)}/{kind}"


class GrowingPaths(Paths):
    """Paths of a run that is still computed: the actual one grows."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Take where the tasks' points will have to be, from a preview.

        Args:
            motion: The preview: where the robot is in it does not matter.
            root: The layer's node.
        """
        super().__init__(motion, root)
        self._rings = dict.fromkeys(self._paths, 0)
        self._pieces = 0

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        radius = PATH_RADIUS * size
        for name, (wanted, was) in self._paths.items():
            self._paths[name] = wanted, was[:0]
            color = color_number(self._color)
            yield set_trail(self._path(name, "actual"), was[:0], radius, color)
        yield from super().draw(size)

    def extend(self, motion: Motion) -> Iterator[Command]:
        """Yield what makes the actual paths longer by a part of the run."""
        self._pieces += 1
        for target in read_targets(motion.rows):
            if target.name in self._rings:
                path = self._path(target.name, "actual")
                yield extend_trail(path, target.actual, self._pieces)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along a part of the run."""
        count = len(motion.times)
        for name, before in self._rings.items():
            rings = np.arange(before, before + count, dtype=float)[:, None]
            yield Track(self._path(name, "actual"), "length", motion.times, rings)
            self._rings[name] = before + count


def _ring_rows(count: int) -> Array:
    return np.linspace(0, count - 1, min(count, _MOST_RINGS)).round().astype(int)
