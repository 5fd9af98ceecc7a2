"""Draws a run: the motion of its robot, and the layers."""

from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.analysis import from_the_start
from hsp_control.companions.viewer.arrows import contacts, ellipsoid, self_motion
from hsp_control.companions.viewer.clearances import capsules, distances, influence
from hsp_control.companions.viewer.clip import Band, Clip
from hsp_control.companions.viewer.commands import (
    LegendEntry,
    PageCommand,
    delete,
    set_property,
)
from hsp_control.companions.viewer.frame_axes import frame_axes
from hsp_control.companions.viewer.motion import Layer, RunMotion, Track
from hsp_control.companions.viewer.obstacles import (
    logged_shapes,
    obstacle_layer,
    points_around,
    solid_layer,
)
from hsp_control.companions.viewer.robot_drawing import RobotDrawing, robot_entry
from hsp_control.companions.viewer.targets import desired_points, paths, target_markers
from hsp_control.config.scenario import ShownItems
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot

LAYERS = tuple(name for name in ShownItems().all_fields() if name != "grid")
"""The layers: nodes of the scene tree, and keys of ``view: show``, in their order."""


def all_layers(
    robot: Robot,
    motion: RunMotion,
    controller: Controller | None,
    *,
    root: str = "",
    dark: bool = False,
) -> dict[str, Layer]:
    """Return the layers of a run, by name."""
    layers = {
        "paths": paths(motion, f"{root}/paths"),
        "targets": target_markers(motion, f"{root}/targets"),
        "obstacles": obstacle_layer(motion, f"{root}/obstacles"),
        "solids": solid_layer(motion, f"{root}/solids"),
        "ellipsoid": ellipsoid(robot, controller, f"{root}/ellipsoid"),
        "contacts": contacts(robot, motion, f"{root}/contacts"),
        "frames": frame_axes(robot, motion, f"{root}/frames"),
    }
    if controller is not None:
        controller = from_the_start(controller, motion.rows)
        shown, ink = logged_shapes(motion.rows), line_color(dark=dark)
        layers |= {
            "influence": influence(controller.field, shown, f"{root}/influence"),
            "distances": distances(controller, f"{root}/distances", ink),
            "capsules": capsules(controller, f"{root}/capsules"),
        }
        # A robot's own log has no field.
        if "field.g" in motion.rows and np.isfinite(motion.rows["field.g"]).any():
            arrows = self_motion(controller, motion, f"{root}/self_motion")
            layers["self_motion"] = arrows
    return layers


def line_color(*, dark: bool) -> str:
    """Return the colour of lines on a light or on a dark background."""
    return palette.WALL if dark else palette.INK


class RunDrawing:
    """A run: the robot's motion and the layers."""

    def __init__(
        self,
        drawing: RobotDrawing,
        motion: RunMotion,
        layers: dict[str, Layer],
        *,
        root: str = "",
        shown: Mapping[str, bool],
        bands: Sequence[Band] = (),
    ) -> None:
        """Compose the drawing."""
        self.motion = motion
        self.layers = layers
        self._drawing = drawing
        self._root = root
        self._bands = bands
        self._shown = shown

    def draw(self, size: float) -> Iterator[PageCommand]:
        """Yield the commands that draw the layers in a scene of the given size [m]."""
        for name in self.layers:
            yield from self.draw_layer(name, size)

    def draw_layer(self, name: str, size: float) -> Iterator[PageCommand]:
        """Yield the commands that draw one layer; see `draw`."""
        layer = self.layers[name]
        yield from layer.draw(size)
        if not self._shown[name]:
            # Not the node of the layer itself: each row of the legend is one switch.
            for path in (path for entry in layer.legend() for path in entry.paths):
                yield set_property(path, "visible", False)

    def clip(self) -> Clip:
        """Return the clip of robot and layers."""
        times, tracks = self.motion.times, list(self.tracks(self.motion))
        return Clip(float(times[0]), float(times[-1]), tracks, bands=self._bands)

    def tracks(self, motion: RunMotion) -> Iterator[Track]:
        """Yield the tracks of robot and layers along the run, or along a part of it."""
        yield from self._drawing.tracks(motion)
        for layer in self.layers.values():
            yield from layer.tracks(motion)

    def points(self) -> Array:
        """Return the positions of robot and targets in the run [m], shape (K, 3)."""
        rows = self.motion.rows
        skeleton = rows["skeleton"] if "skeleton" in rows else np.zeros((0, 3))
        return np.concatenate([skeleton.reshape(-1, 3), desired_points(self.motion)])

    def obstacle_points(self) -> Array:
        """Return points that enclose obstacles and solids in the run [m], (K, 3)."""
        return points_around(self.motion.rows)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries of all layers, and the robot's."""
        entries = [
            entry._replace(shown=self._shown[name])
            for name in sorted(self.layers, key=LAYERS.index)
            for entry in self.layers[name].legend()
        ]
        return [*entries, robot_entry(f"{self._root}/robot")]


def clear() -> Iterator[PageCommand]:
    """Yield the commands that delete all layers."""
    for name in LAYERS:
        yield delete(f"/{name}")
