"""Several runs in one scene: over each other as ghosts, or side by side."""

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette
from hsp_control.visualization.viewer.appearance import ACTUAL
from hsp_control.visualization.viewer.clip import Clip
from hsp_control.visualization.viewer.commands import Command, set_ghost, set_transform
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.motion import motion_of
from hsp_control.visualization.viewer.poses import moved_to
from hsp_control.visualization.viewer.robot_drawing import RobotDrawing
from hsp_control.visualization.viewer.run_drawing import (
    RunDrawing,
    all_layers,
    ghost_layers,
)
from hsp_control.visualization.viewer.self_motion import SelfMotion
from hsp_control.visualization.viewer.stage import in_sight

GHOSTS = (palette.TASK, palette.SERIES[4], palette.WARNING)
"""Colours of the second run, the third and so on."""
_OPACITY = 0.38
_GAP = 0.35
"""Between two robots, over the width of one."""


class Act(NamedTuple):
    """A run that is shown with others.

    Attributes:
        name: What the legend calls it.
        robot: Its robot.
        rollout: The run.
        controller: What controlled it; see `RunDrawing`.
    """

    name: str
    robot: Robot
    rollout: Rollout
    controller: Controller | None = None


class Comparison:
    """Runs that are played together, in one time."""

    def __init__(
        self,
        drawing: RobotDrawing,
        acts: Sequence[Act],
        *,
        shown: Mapping[str, bool],
        beside: Array | None,
        dark: bool,
    ) -> None:
        """Read the logs.

        Args:
            drawing: The first robot in the scene; the others are drawn here.
            acts: The runs.
            shown: Whether each layer is shown at first.
            beside: The direction in which to set the runs side by side, a unit vector
                of shape (3,); None: over each other, all but the first as ghosts.
            dark: Whether the background is.
        """
        self._names = [act.name for act in acts]
        self.roots = ["", *(f"/{element(act.name)}" for act in acts[1:])]
        self._beside = beside
        self._drawings = [drawing]
        self._runs: list[RunDrawing] = []
        for number, (act, root) in enumerate(zip(acts, self.roots, strict=True)):
            if number:
                self._drawings.append(RobotDrawing(act.robot, f"{root}/robot"))
            motion = motion_of(act.robot, act.rollout)
            layers = (
                ghost_layers(motion, _color(number), root)
                if number and beside is None
                else all_layers(act.robot, motion, act.controller, root=root, dark=dark)
            )
            drawing = self._drawings[-1]
            self._runs.append(
                RunDrawing(drawing, motion, layers, root=root, shown=shown)
            )
        self._places = self._offsets()
        moving = [run.layers.get("self_motion") for run in self._runs]
        arrows = [layer for layer in moving if isinstance(layer, SelfMotion)]
        for layer in arrows:  # what is compared has one scale
            layer.seconds = min(each.seconds for each in arrows)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts the runs, and all robots but the first, into the scene."""
        for number, (run, root) in enumerate(zip(self._runs, self.roots, strict=True)):
            if number:
                yield from self._drawings[number].draw()
            yield from run.draw(size)
            if not number:
                continue
            yield set_transform(root, moved_to(self._places[number]))
            if self._beside is None:
                yield set_ghost(f"{root}/robot", _color(number), _OPACITY)

    def clip(self) -> Clip:
        """Return how everything moves; a run that ends early waits for the others."""
        clips = [run.clip() for run in self._runs]
        return Clip(
            min(clip.start for clip in clips),
            max(clip.end for clip in clips),
            [track for clip in clips for track in clip.tracks],
        )

    def points(self) -> Array:
        """Return where robots and targets are [m], shape (K, 3)."""
        runs = zip(self._runs, self._places, strict=True)
        return np.concatenate([run.points() + place for run, place in runs])

    def obstacle_points(self) -> Array:
        """Return points that enclose the obstacles [m], shape (K, 3)."""
        runs = zip(self._runs, self._places, strict=True)
        return np.concatenate([run.obstacle_points() + place for run, place in runs])

    def title(self) -> str:
        """Return the runs' names."""
        return (" | " if self._beside is not None else " and ").join(self._names)

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        if self._beside is not None:
            return list(dict.fromkeys(e for run in self._runs for e in run.legend()))
        named = [(self._names[0], ACTUAL)]
        named += [(name, _color(k)) for k, name in enumerate(self._names) if k]
        rest = [entry for entry in self._runs[0].legend() if entry[1] != ACTUAL]
        return named + rest

    def _offsets(self) -> list[Array]:
        """Return where each run stands [m]."""
        if self._beside is None:
            return [np.zeros(3) for _ in self._runs]
        places: list[Array] = []
        edge = 0.0
        for run in self._runs:
            own = np.vstack([run.points(), np.zeros((1, 3))])
            across = in_sight(own, run.obstacle_points()) @ self._beside
            low, high = float(across.min()), float(across.max())
            shift = 0.0 if not places else edge - low
            places.append(shift * self._beside)
            edge = shift + high + _GAP * (high - low)
        return places


def _color(number: int) -> str:
    return GHOSTS[(number - 1) % len(GHOSTS)]
