"""Contact forces of a log: arrows at the contact points."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import ARROW_RADIUS, CONTACT
from hsp_control.visualization.viewer.arrows import arrow_tracks, unit_arrow
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.materials import always_visible, material
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.scene_path import path_element

_PREFIX, _FORCE, _POSITION = "contact.", ".force", ".position"
_WEIGHT_LENGTH = 0.5
"""Length of an arrow that shows the robot's weight, over the robot's size."""
_GRAVITY = 9.81  # m/s²


class Contacts:
    """Contact forces, from the columns ``contact.<name>.position`` and ``.force``."""

    def __init__(self, robot: Robot, motion: Motion, root: str) -> None:
        """Find the contacts."""
        self._root = root
        self._weight = _GRAVITY * sum(inertia.mass for inertia in robot.model.inertias)
        self._size = motion.size
        columns = motion.rows.columns
        self._names = [
            name
            for column in columns
            if column.startswith(_PREFIX) and column.endswith(_FORCE)
            for name in [column[len(_PREFIX) : -len(_FORCE)]]
            if f"{_PREFIX}{name}{_POSITION}" in columns
        ]

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for name in self._names:
            surface = always_visible(
                material(CONTACT, glow=0.5)
            )  # contacts lie inside the legs' meshes
            arrow = unit_arrow(surface, ARROW_RADIUS * self._size)
            yield set_object(self._path(name, "force"), arrow)
            ball = threejs.sphere(1.5 * ARROW_RADIUS * self._size)
            yield set_object(
                self._path(name, "point"), threejs.group([threejs.mesh(ball, surface)])
            )

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield its tracks along the run; a contact without force is hidden."""
        times = motion.times
        for name in self._names:
            position = _held(motion.rows[f"{_PREFIX}{name}{_POSITION}"])
            force = motion.rows[f"{_PREFIX}{name}{_FORCE}"]
            arrows = _WEIGHT_LENGTH * self._size / self._weight * force
            radius = ARROW_RADIUS * self._size
            path = self._path(name, "force")
            yield from arrow_tracks(path, times, position, arrows, radius)
            touches = np.linalg.norm(force, axis=1) > 0.0
            yield Track(self._path(name, "point"), "position", times, position)
            shown = touches.astype(float)[:, None]
            yield Track(self._path(name, "point"), "visible", times, shown)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entries."""
        name = LegendEntry("contact force", CONTACT, (self._root,))
        return [name] if self._names else []

    def _path(self, name: str, kind: str) -> str:
        return f"{self._root}/{path_element(name)}/{kind}"


def _held(positions: Array) -> Array:
    """Return positions with NaN, of inactive contacts, replaced by the last position.

    Shapes: positions (N, 3) [m].
    """
    known = np.flatnonzero(np.isfinite(positions).all(axis=1))
    if not known.size:
        return np.zeros_like(positions)
    latest = np.searchsorted(known, np.arange(len(positions)), side="right") - 1
    return np.asarray(positions[known[np.maximum(latest, 0)]])
