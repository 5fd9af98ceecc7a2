"""Contact forces, where a log has any: arrows at the points of contact."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.robot import Robot
from hsp_control.visualization.viewer import threejs
from hsp_control.visualization.viewer.appearance import ARROW_RADIUS, CONTACT
from hsp_control.visualization.viewer.arrows import arrow_tracks, unit_arrow
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object
from hsp_control.visualization.viewer.element import element
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.surfaces import material, seen_through

_PREFIX, _FORCE, _PLACE = "contact.", ".force", ".position"
_WEIGHT = 0.5
"""Length of a force that carries the robot's weight, over the robot's size."""
_GRAVITY = 9.81  # m/s²


class Contacts:
    """Forces on the robot, of columns ``contact.<name>.position`` and ``.force``."""

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
            if f"{_PREFIX}{name}{_PLACE}" in columns
        ]

    def draw(self, size: float) -> Iterator[Command]:
        """Yield what puts it into a scene of some size [m]."""
        for name in self._names:
            surface = seen_through(material(CONTACT, glow=0.5))  # legs are thick
            arrow = unit_arrow(surface, ARROW_RADIUS * self._size)
            yield set_object(self._path(name, "force"), arrow)
            ball = threejs.sphere(1.5 * ARROW_RADIUS * self._size)
            yield set_object(
                self._path(name, "point"), threejs.group([threejs.mesh(ball, surface)])
            )

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield how it moves along the run; a contact without force is not shown."""
        times = motion.times
        for name in self._names:
            place = _held(motion.rows[f"{_PREFIX}{name}{_PLACE}"])
            force = motion.rows[f"{_PREFIX}{name}{_FORCE}"]
            arrows = _WEIGHT * self._size / self._weight * force
            radius = ARROW_RADIUS * self._size
            path = self._path(name, "force")
            yield from arrow_tracks(path, times, place, arrows, radius)
            touches = np.linalg.norm(force, axis=1) > 0.0
            yield Track(self._path(name, "point"), "position", times, place)
            shown = touches.astype(float)[:, None]
            yield Track(self._path(name, "point"), "visible", times, shown)

    def legend(self) -> list[tuple[str, str]]:
        """Return names and colours."""
        return [("contact force", CONTACT)] if self._names else []

    def _path(self, name: str, kind: str) -> str:
        return f"{self._root}/{element(name)}/{kind}"


def _held(places: Array) -> Array:
    """Return places with those of a contact that is off, which are NaN, held."""
    known = np.flatnonzero(np.isfinite(places).all(axis=1))
    if not known.size:
        return np.zeros_like(places)
    latest = np.searchsorted(known, np.arange(len(places)), side="right") - 1
    return np.asarray(places[known[np.maximum(latest, 0)]])
