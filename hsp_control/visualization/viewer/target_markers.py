"""Markers of the tasks' current targets: a ball, an arrow, or three axes."""

from collections.abc import Iterator

import numpy as np

from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import AXES, DESIRED, PATH_RADIUS
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, Json, set_object
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.materials import material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.poses import pose_along, quaternions_along
from hsp_control.visualization.viewer.scene_path import path_element
from hsp_control.visualization.viewer.targets import Target, read_targets


class TargetMarkers:
    """The targets of all tasks that can be shown in space."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Find the tasks that have a target in space."""
        self._root = root
        self._targets = read_targets(motion.rows)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for target in self._targets:
            yield set_object(self._path(target), _mark(target, PATH_RADIUS * size))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        times = motion.times
        for target in read_targets(motion.rows):
            path = self._path(target)
            position = target.actual if target.desired is None else target.desired
            yield Track(path, "position", times, position)
            if target.rotation is not None:
                yield Track(path, "quaternion", times, target.rotation)
            elif target.direction is not None:
                turned = quaternions_along(target.direction)
                yield Track(path, "quaternion", times, turned)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        name = "target" if len(self._targets) == 1 else "targets"
        paths = tuple(map(self._path, self._targets))
        return [LegendEntry(name, DESIRED, paths)] if paths else []

    def _path(self, target: Target) -> str:
        return f"{self._root}/{path_element(target.name)}"


def _mark(target: Target, radius: float) -> Json:
    if target.direction is not None:
        surface = material(DESIRED)
        return threejs.group(
            [threejs.mesh(threejs.arrow(60 * radius, 2 * radius), surface)]
        )
    if target.rotation is None:
        surface = material(DESIRED)
        return threejs.group([threejs.mesh(threejs.sphere(4.5 * radius), surface)])
    arrows = []
    for axis, color in zip(np.eye(3), AXES, strict=True):
        body = threejs.arrow(40.0 * radius, 1.5 * radius)
        arrows.append(threejs.mesh(body, material(color), pose_along(axis)))
    return threejs.group(arrows)
