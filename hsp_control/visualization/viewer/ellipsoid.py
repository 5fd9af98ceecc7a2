"""The manipulability ellipsoid (Yoshikawa 1985): the hand's speed per direction."""

from collections.abc import Iterator
from itertools import permutations

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.robot import Robot
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import (
    ELLIPSOID,
    ELLIPSOID_OPACITY,
    LegendEntry,
    translucent,
)
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, path_element, set_object
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.threejs import material

SECONDS = 0.2
"""A semi-axis is the hand's travel in this time at a joint speed of norm 1 [s]."""
_THINNEST = 0.02
"""Minimum semi-axis, over the longest: a flat ellipsoid is drawn as a disk."""


class Ellipsoid:
    """The image {J v : |v| = 1} of unit joint velocities, at each task's frame."""

    def __init__(self, robot: Robot, controller: Controller | None, root: str) -> None:
        """Find the frames: those of the tasks, or else the robot's end effector."""
        self._root = root
        tasks = controller.tasks if controller else ()
        named = (getattr(task, "frame", None) for task in tasks)
        frames = dict.fromkeys(frame for frame in named if frame)
        self._frames = tuple(frames) or (robot.end_effector,)

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for frame in self._frames:
            surface = material(ELLIPSOID, opacity=ELLIPSOID_OPACITY, glow=0.4)
            ball = threejs.mesh(threejs.sphere(1.0), surface, shadow=False)
            yield set_object(self._path(frame), threejs.group([ball]))

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run."""
        rows = len(motion.times)
        for frame in self._frames:
            places, turns, axes = np.empty((rows, 3)), np.empty((rows, 4)), []
            last = np.eye(3)
            for row, state in enumerate(motion.states()):
                kinematics = state.frame(frame)
                places[row] = kinematics.position
                last, lengths = principal_axes(kinematics.jacobian[:3], last)
                turns[row] = pin.Quaternion(last).coeffs()
                axes.append(np.maximum(lengths, _THINNEST * lengths.max()))
            path = self._path(frame)
            yield Track(path, "position", motion.times, places)
            yield Track(path, "quaternion", motion.times, turns)
            yield Track(path, "scale", motion.times, SECONDS * np.array(axes))

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        paths = tuple(map(self._path, self._frames))
        color = translucent(ELLIPSOID, 2.0 * ELLIPSOID_OPACITY)
        return [LegendEntry("manipulability", color, paths)]

    def _path(self, frame: str) -> str:
        return f"{self._root}/{path_element(frame)}"


def principal_axes(J: Array, last: Array) -> tuple[Array, Array]:
    """Return the axes of {J v : |v| = 1}, nearest to ``last``, and semi-axes."""
    axes, lengths, _ = np.linalg.svd(J)
    padded = np.zeros(3)
    padded[: len(lengths)] = lengths
    overlap = last.T @ axes
    orders = [list(order) for order in permutations(range(3))]
    order = max(orders, key=lambda o: float(np.abs(overlap[range(3), o]).sum()))
    axes = axes[:, order] * np.where(overlap[range(3), order] < 0.0, -1.0, 1.0)
    if np.linalg.det(axes) < 0.0:
        axes[:, 2] *= -1.0
    return axes, padded[order]
