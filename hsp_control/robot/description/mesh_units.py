"""The unit of a mesh file and its up axis, where the file gives them.

A Collada file has ``<unit>`` and ``<up_axis>``, and glTF is in metres with y up. The
readers of meshes, Coal and Meshcat's page, leave vertices as they are in the file.
"""

import math
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from xml.parsers import expat

import numpy as np

from hsp_control.common.arrays import Array

_TURNS = {
    "X_UP": ((0, -1, 0), (0, 0, -1), (1, 0, 0)),
    "Y_UP": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "Z_UP": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
}
"""From a file's axes to those of a link, whose z is up: Collada 1.4, ``up_axis``."""


class MeshUnits(NamedTuple):
    """The unit and the axes of a mesh file."""

    unit: float = 1.0  # the length of the file's unit [m]
    up: str = "Z_UP"  # ``X_UP``, ``Y_UP`` or ``Z_UP``

    @property
    def turn(self) -> Array:
        """The rotation from the file's axes to the link's, shape (3, 3)."""
        return np.array(_TURNS[self.up], dtype=float)

    def scale(self, given: Array) -> Array:
        """Return a scale (3,) along the link's axes as one along the file's, in m."""
        return np.asarray(self.unit * np.abs(self.turn).T @ given)


def mesh_units(file: Path) -> MeshUnits:
    """Return a mesh file's unit and axes; by default metres, with z up.

    Raises:
        ValueError: If the unit is no positive length, or there is no such axis.
    """
    ending = file.suffix.lower()
    if ending in (".gltf", ".glb"):
        return MeshUnits(up="Y_UP")
    return _of_collada(file.read_bytes()) if ending == ".dae" else MeshUnits()


class _EndError(Exception):
    """Ends a parse after the asset."""


def _of_collada(data: bytes) -> MeshUnits:
    """Return those of the first ``<asset>``, which are the whole file's."""
    parser = expat.ParserCreate()
    unit, up = "1", ""
    within = ""

    def start(name: str, attributes: dict[str, str]) -> None:
        nonlocal unit, within
        within = name
        if name == "unit":
            unit = attributes.get("meter", "1")

    def text(data: str) -> None:
        nonlocal up
        if within == "up_axis":
            up += data

    def end(name: str) -> None:
        nonlocal within
        within = ""
        if name == "asset":
            raise _EndError

    parser.StartElementHandler, parser.EndElementHandler = start, end
    parser.CharacterDataHandler = text
    with suppress(expat.ExpatError, _EndError):  # malformed files are left to others
        parser.Parse(data, True)
    try:
        length = float(unit)
    except ValueError:
        length = math.nan
    if not 0.0 < length < math.inf:
        raise ValueError(f'<unit meter="{unit[:40]}">; must be a positive length')
    up = up.strip() or "Z_UP"
    if up not in _TURNS:
        raise ValueError(f"<up_axis>{up[:40]}; must be one of {', '.join(_TURNS)}")
    return MeshUnits(length, up)
