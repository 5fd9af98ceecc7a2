"""The layer of the solid things that the robot of a simulation may touch."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.geometry.shapes import Shape, shape_from_log
from hsp_control.simulation.plants.mujoco.solids import Solid
from hsp_control.visualization.viewer.appearance import SOLID
from hsp_control.visualization.viewer.clip import Track
from hsp_control.visualization.viewer.commands import Command, set_object, set_transform
from hsp_control.visualization.viewer.legend import LegendEntry
from hsp_control.visualization.viewer.motion import Motion
from hsp_control.visualization.viewer.obstacle_drawing import enclosing_corners
from hsp_control.visualization.viewer.obstacle_shapes import obstacle
from hsp_control.visualization.viewer.scene_path import path_element


class _Drawn(NamedTuple):
    """A solid, or one of its copies."""

    path: str
    shape: Shape
    placement: pin.SE3  # where it is, or where it starts if it is loose
    column: str  # where the log has its motion: the start of two columns' names


class SolidLayer:
    """The solids of the plant that a log names: fixed ones, and loose ones."""

    def __init__(self, motion: Motion, root: str) -> None:
        """Read the log's plant."""
        self._root, self._rows = root, motion.rows
        solids = solids_of(motion.rows.meta)
        self.names = [solid.name for solid in solids]
        self._drawn = [
            _Drawn(
                f"{root}/{path_element(geom)}",
                solid.shape,
                placed.placement,
                f"plant.solid.{solid.name}" + (f"_{k + 1}" if k else ""),
            )
            for solid in solids
            for k, (geom, placed) in enumerate(solid.geoms())
        ]

    def draw(self, size: float) -> Iterator[Command]:
        """Yield the commands that draw it in a scene of the given size [m]."""
        for each in self._drawn:
            yield set_object(each.path, obstacle(each.shape, 4.0 * size, SOLID))
            yield set_transform(each.path, each.placement.homogeneous)

    def tracks(self, motion: Motion) -> Iterator[Track]:
        """Yield the tracks of loose solids along the run."""
        for each in self._drawn:
            for what in ("position", "quaternion"):
                if (name := f"{each.column}.{what}") in motion.rows:
                    yield Track(each.path, what, motion.times, motion.rows[name])

    def points(self) -> Array:
        """Return points that enclose them in the run [m], shape (K, 3)."""
        clouds = [np.zeros((0, 3))]
        for each in self._drawn:
            name = f"{each.column}.position"
            moved = name in self._rows
            center = self._rows[name] if moved else each.placement.translation
            corners = enclosing_corners(each.shape, center)
            clouds += [corner.reshape(-1, 3) for corner in corners]
        return np.concatenate(clouds)

    def legend(self) -> list[LegendEntry]:
        """Return the legend's entry; none without solids."""
        if not self.names:
            return []
        word = "solid" if len(self.names) == 1 else "solids"
        return [LegendEntry(f"{word} {', '.join(self.names)}", SOLID, (self._root,))]


def solids_of(meta: Mapping[str, Any]) -> list[Solid]:
    """Return the solids of a log's plant."""
    found = []
    for entry in (meta.get("plant") or {}).get("solids", ()):
        given = {key: entry[key] for key in _FIELDS if key in entry}
        shape = dict(given["shape"])
        given["shape"] = shape_from_log(shape.pop("type"), shape)
        found.append(Solid(**given))
    return found


_FIELDS = ("name", "shape", "position", "rotation", "mass", "copies", "spacing")
