"""The legend's entries: each names a colour, and switches what has it."""

from collections.abc import Iterable
from typing import NamedTuple


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
