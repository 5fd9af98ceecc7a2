"""Several runs in one scene: overlaid, the others as ghosts or not, or side by side."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.plots import palette
from hsp_control.companions.viewer.arrows import SelfMotionLayer
from hsp_control.companions.viewer.clip import Clip, bands_of
from hsp_control.companions.viewer.commands import (
    LegendEntry,
    PageCommand,
    path_element,
    set_ghost,
    set_transform,
)
from hsp_control.companions.viewer.motion import motion_of
from hsp_control.companions.viewer.robot_drawing import RobotDrawing
from hsp_control.companions.viewer.run_drawing import LAYERS, RunDrawing, all_layers
from hsp_control.companions.viewer.stage import in_sight
from hsp_control.companions.viewer.targets import paths
from hsp_control.companions.viewer.threejs import pose_at
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout

GHOSTS = (palette.TASK, palette.SERIES[4], palette.WARNING)
"""Colours of the second run, the third and so on."""
GHOST_OPACITY = 0.38  # opacity of a ghost
_GAP = 0.35  # gap between two robots, over the width of one


class ComparedRun(NamedTuple):
    """A run that is compared with others.

    Attributes:
        name: Its name in the legend.
        robot: Its robot.
        rollout: The run.
        controller: Its controller, for layers that need more than the log's columns.
    """

    name: str
    robot: Robot
    rollout: Rollout
    controller: Controller | None = None


class Comparison:
    """Several runs that are played together, on one time axis."""

    def __init__(
        self,
        drawing: RobotDrawing,
        runs: Sequence[ComparedRun],
        *,
        shown: Mapping[str, bool],
        beside: Array | None,
        dark: bool,
        ghosts: bool = True,
    ) -> None:
        """Read the logs."""
        self._names = [run.name for run in runs]
        self.roots = run_roots(self._names)
        self._beside = beside
        self._ghosts = ghosts and beside is None
        self._drawings = [drawing]
        self._runs: list[RunDrawing] = []
        for number, (run, root) in enumerate(zip(runs, self.roots, strict=True)):
            if number:
                self._drawings.append(RobotDrawing(run.robot, f"{root}/robot"))
            motion = motion_of(run.robot, run.rollout)
            layers = (
                {
                    "paths": paths(
                        motion, f"{root}/paths", ghost_color(number), ghost=True
                    )
                }
                if number and self._ghosts
                else all_layers(run.robot, motion, run.controller, root=root, dark=dark)
            )
            drawing = self._drawings[-1]
            known = bands_of(run.rollout, run.controller)
            bands = [band.of_run(run.name) for band in known]
            self._runs.append(
                RunDrawing(drawing, motion, layers, root=root, shown=shown, bands=bands)
            )
        self._offsets = self._compute_offsets()
        moving = [run.layers.get("self_motion") for run in self._runs]
        arrows = [layer for layer in moving if isinstance(layer, SelfMotionLayer)]
        for layer in arrows:  # compared arrows share one scale
            layer.seconds = min(other.seconds for other in arrows)

    def draw(self, size: float) -> Iterator[PageCommand]:
        """Yield the commands that draw the runs, and all robots but the first."""
        for number, (run, root) in enumerate(zip(self._runs, self.roots, strict=True)):
            if number:
                yield from self._drawings[number].draw()
            yield from run.draw(size)
            if not number:
                continue
            yield set_transform(root, pose_at(self._offsets[number]))
            if self._ghosts:
                yield set_ghost(f"{root}/robot", ghost_color(number), GHOST_OPACITY)

    def clip(self) -> Clip:
        """Return the clip of all runs; a run that ends early keeps its last pose."""
        clips = [run.clip() for run in self._runs]
        return Clip(
            min(clip.start for clip in clips),
            max(clip.end for clip in clips),
            [track for clip in clips for track in clip.tracks],
            bands=[band for clip in clips for band in clip.bands],
        )

    def points(self) -> Array:
        """Return where robots and targets are [m], shape (K, 3)."""
        runs = zip(self._runs, self._offsets, strict=True)
        return np.concatenate([run.points() + offset for run, offset in runs])

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles [m], shape (K, 3)."""
        runs = zip(self._runs, self._offsets, strict=True)
        return np.concatenate([run.obstacle_points() + offset for run, offset in runs])

    def title(self) -> str:
        """Return the common title of the runs, or else their names."""
        titles = {str(run.motion.rows.meta.get("title") or "") for run in self._runs}
        if len(titles) == 1 and (title := titles.pop()):
            return title
        return (" | " if self._beside is not None else " and ").join(self._names)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        if not self._ghosts:
            return _merged(entry for run in self._runs for entry in run.legend())
        # A ghost is everything below its node; the first run is its robot and actual
        # path.
        entries = self._runs[0].legend()
        first = [e for e in entries if e.color == palette.ACTUAL or e.name == "robot"]
        shown = tuple(path for entry in first for path in entry.paths)
        return [
            LegendEntry(self._names[0], palette.ACTUAL, shown),
            *(
                LegendEntry(name, ghost_color(k), (self.roots[k],))
                for k, name in enumerate(self._names)
                if k
            ),
            *(entry for entry in entries if entry not in first),
        ]

    def _compute_offsets(self) -> list[Array]:
        """Return the offsets of the runs [m], shapes (3,)."""
        if self._beside is None:
            return [np.zeros(3) for _ in self._runs]
        offsets: list[Array] = []
        edge = 0.0
        for run in self._runs:
            own = np.vstack([run.points(), np.zeros((1, 3))])
            across = in_sight(own, run.obstacle_points()) @ self._beside
            low, high = float(across.min()), float(across.max())
            shift = 0.0 if not offsets else edge - low
            offsets.append(shift * self._beside)
            edge = shift + high + _GAP * (high - low)
        return offsets


def _merged(entries: Iterable[LegendEntry]) -> list[LegendEntry]:
    """Return the entries with those of the same name and colour made into one."""
    rows: dict[tuple[str, str], LegendEntry] = {}
    for entry in entries:
        known = rows.setdefault((entry.name, entry.color), entry._replace(paths=()))
        merged = known._replace(paths=(*known.paths, *entry.paths))
        rows[entry.name, entry.color] = merged
    return list(rows.values())


def run_roots(names: Sequence[str]) -> list[str]:
    """Return the root nodes of the runs; "" for the first."""
    taken = {"robot", "floor", "lights", *LAYERS}
    elements = map(path_element, names[1:])
    return ["", *(f"/run {e}" if e in taken else f"/{e}" for e in elements)]


def run_parts(names: Sequence[str]) -> list[list[str]]:
    """Return the nodes of each run that together contain everything drawn for it."""
    first = [f"/{name}" for name in ("robot", *LAYERS)]
    return [first, *([root] for root in run_roots(names)[1:])]


def ghost_color(number: int) -> str:
    """Return the colour of a run's ghost; runs are numbered from 0."""
    return GHOSTS[(number - 1) % len(GHOSTS)]
