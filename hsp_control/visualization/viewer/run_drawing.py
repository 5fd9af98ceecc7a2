"""Draws a run: the motion of its robot, and the layers."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Protocol

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot
from hsp_control.visualization.viewer.analysis import from_the_start
from hsp_control.visualization.viewer.appearance import CHALK, INK, LegendEntry
from hsp_control.visualization.viewer.arrows import Contacts, Ellipsoid, SelfMotion
from hsp_control.visualization.viewer.clearances import (
    Capsules,
    Distances,
    Influence,
)
from hsp_control.visualization.viewer.clip import Band, Clip, Track
from hsp_control.visualization.viewer.commands import Command, delete, set_property
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacles import ObstacleLayer, SolidLayer
from hsp_control.visualization.viewer.robot_drawing import RobotDrawing, robot_entry
from hsp_control.visualization.viewer.targets import Paths, TargetMarkers


class Layer(Protocol):
    """Draws itself once, and returns the tracks of its motion."""

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along a run, or along a part of one."""

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""


LAYERS = (
    "paths",
    "targets",
    "obstacles",
    "solids",
    "influence",
    "distances",
    "capsules",
    "ellipsoid",
    "self_motion",
    "contacts",
)
"""The layers: nodes of the scene tree, and keys of ``view: show``, in their order."""


def all_layers(
    robot: Robot,
    motion: Motion,
    controller: Controller | None,
    *,
    root: str = "",
    dark: bool = False,
) -> dict[str, Layer]:
    """Return the layers of a run, by name."""
    ink = CHALK if dark else INK
    obstacles = ObstacleLayer(motion, f"{root}/obstacles")
    layers: dict[str, Layer] = {
        "paths": Paths(motion, f"{root}/paths"),
        "targets": TargetMarkers(motion, f"{root}/targets"),
        "obstacles": obstacles,
        "solids": SolidLayer(motion, f"{root}/solids"),
        "ellipsoid": Ellipsoid(robot, controller, f"{root}/ellipsoid"),
        "contacts": Contacts(robot, motion, f"{root}/contacts"),
    }
    if controller is not None:
        controller = from_the_start(controller)
        layers |= {
            "influence": Influence(
                controller.field, obstacles.shapes, f"{root}/influence"
            ),
            "distances": Distances(controller, f"{root}/distances", ink),
            "capsules": Capsules(controller, f"{root}/capsules"),
        }
        if "field.g" in motion.rows:
            arrows = SelfMotion(controller, motion, f"{root}/self_motion")
            layers["self_motion"] = arrows
    return layers


def ghost_layers(motion: Motion, color: str, root: str) -> dict[str, Layer]:
    """Return the layers of a ghost: only its path, in a colour."""
    return {"paths": Paths(motion, f"{root}/paths", color, ghost=True)}


class RunDrawing:
    """A run: the robot's motion and the layers."""

    def __init__(
        self,
        drawing: RobotDrawing,
        motion: Motion,
        layers: dict[str, Layer],
        *,
        root: str = "",
        shown: Mapping[str, bool] | None = None,
        bands: Sequence[Band] = (),
    ) -> None:
        """Compose the drawing."""
        self.motion = motion
        self.layers = layers
        self._drawing = drawing
        self._root = root
        self._bands = bands
        self._shown = dict.fromkeys(LAYERS, True) | dict(shown or {})

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw the layers in a scene of the given size [m]."""
        for name in self.layers:
            yield from self.draw_layer(name, size)

    def draw_layer(self, name: str, size: float) -> Iterator[Command]:
        """Yield the commands that draw one layer; see `draw`."""
        layer = self.layers[name]
        yield from layer.draw(size)
        if not self._shown[name]:
            # Not the layer's own node: each row of the legend is one switch.
            for path in (path for entry in layer.legend() for path in entry.paths):
                yield set_property(path, "visible", False)

    def clip(self) -> Clip:
        """Return the clip of robot and layers."""
        times, tracks = self.motion.times, list(self.tracks(self.motion))
        return Clip(float(times[0]), float(times[-1]), tracks, bands=self._bands)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield the tracks of robot and layers along the run, or along a part of it."""
        yield from self._drawing.tracks(motion)
        for layer in self.layers.values():
            yield from layer.tracks(motion)

    def points(self) -> Array:
        """Return the positions of robot and targets in the run [m], shape (K, 3)."""
        rows = self.motion.rows
        skeleton = rows["skeleton"] if "skeleton" in rows else np.zeros((0, 3))
        paths = Paths(self.motion, "").points()
        return np.concatenate([skeleton.reshape(-1, 3), paths])

    def obstacle_points(self) -> Array:
        """Return points that enclose obstacles and solids in the run [m], (K, 3)."""
        layers = ObstacleLayer(self.motion, ""), SolidLayer(self.motion, "")
        return np.concatenate([each.points() for each in layers])

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries of all layers, and the robot's."""
        entries = [
            entry._replace(shown=self._shown[name])
            for name in sorted(self.layers, key=LAYERS.index)
            for entry in self.layers[name].legend()
        ]
        return [*entries, robot_entry(f"{self._root}/robot")]


def clear() -> Iterator[Command]:
    """Yield the commands that delete all layers."""
    for name in LAYERS:
        yield delete(f"/{name}")
