"""Colours, opacities and sizes of the objects in the view, and its legend."""

from collections.abc import Iterable
from typing import NamedTuple

from hsp_control.visualization import palette

ACTUAL, DESIRED = palette.ACTUAL, palette.DESIRED
OBSTACLE, SOLID = palette.OBSTACLE, palette.SOLID
LINK, JOINT = palette.LINK, palette.JOINT
AXES = (palette.OBSTACLE, palette.TASK, palette.ACTUAL)
"""x, y and z axis of a target: like red, green, blue, but safe for colour blindness."""

HAZE = 0.19  # share of grey in the background's colour at the horizon
GRID = "#8794A1"

PATH_RADIUS = 0.0045  # radius of the actual path, over the size of the scene
DESIRED_WIDENING = 2.0
"""Radius of the desired path over that of the actual path, which it encloses."""
GHOST_NARROWING = 0.8
"""Radius of a ghost's path over that of the run, which encloses it."""
OBSTACLE_OPACITY = 0.75
ZONE_OPACITY = 0.13
INK, CHALK = palette.INK, palette.WALL
"""Colour of lines on a light and on a dark background."""
BAR_RADIUS = 0.003  # radius of a distance bar, over the size of the scene
BAR_END_RADIUS = 0.0075  # radius of the balls at its ends, over the size of the scene
MEASURED, MEASURED_OPACITY = palette.SERIES[4], 0.3
"""Colour and opacity of the shapes of links that distances are measured with."""
ELLIPSOID, ELLIPSOID_OPACITY = palette.TASK, 0.3
FIELD, FIELD_OPACITY = palette.FIELD, 0.4
ARROW_RADIUS = 0.007  # radius of an arrow's shaft, over the robot's size
CONTACT = palette.WARNING


class LegendEntry(NamedTuple):
    """One row of the legend, and the switch of what it names."""

    name: str
    color: str  # its colour, ``#RRGGBB`` or, if it is translucent, ``#RRGGBBAA``
    paths: tuple[str, ...]  # the nodes of the scene tree that the row shows and hides
    shown: bool = True  # whether they are shown at first
    # Whether the row is only a switch, as what it names explains itself: films leave it
    # out.
    plain: bool = False


def translucent(color: str, opacity: float) -> str:
    """Return ``#RRGGBB`` with an opacity from 0 to 1, as ``#RRGGBBAA``."""
    return f"{color}{round(255 * opacity):02X}"


def merged(entries: Iterable[LegendEntry]) -> list[LegendEntry]:
    """Return the entries with those of the same name and colour made into one."""
    rows: dict[tuple[str, str], LegendEntry] = {}
    for entry in entries:
        key = entry.name, entry.color
        known = rows.get(key)
        paths = (*known.paths, *entry.paths) if known else entry.paths
        rows[key] = entry._replace(paths=paths)
    return list(rows.values())
