"""A clip with few keyframes: what is played stays within a bound of every sample."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.export.packing import ArrayTable
from hsp_control.visualization.viewer.export.thinning import (
    Deviation,
    angle,
    distance,
    on_line,
    on_sphere,
    stays,
    thin,
)

POSITION_BOUND = 2e-4
"""How far a node may be from where the log has it [m]."""
ANGLE_BOUND = np.radians(0.1)
"""How far it may be turned from there [rad]."""
CLOCK_STEP = 1e-6
"""Times are told apart to this [s]."""


class _Property(NamedTuple):
    """How a property is played, and how exactly it is to be.

    Attributes:
        step: What its values are rounded to.
        between: What the player shows between two keyframes; see ``player.js``.
        deviation: Over 1 where that is too far from a sample.
    """

    step: float
    between: Callable[[Array, Array, Array], Array]
    deviation: Deviation


_PROPERTIES = {
    "position": _Property(POSITION_BOUND / 8, on_line, distance(POSITION_BOUND)),
    "quaternion": _Property(2.0**-15, on_sphere, angle(ANGLE_BOUND)),
    "scale": _Property(POSITION_BOUND / 8, on_line, distance(POSITION_BOUND)),
    "color": _Property(1 / 1024, on_line, distance(1 / 256)),
    "opacity": _Property(1 / 1024, on_line, distance(1 / 256)),
    "visible": _Property(1.0, stays, distance(0.5)),
    "length": _Property(1 / 64, on_line, distance(0.25)),
}
"""A property that is not listed is kept as it is."""


def light_clip(command: Json, arrays: ArrayTable) -> Json:
    """Return the command of a clip with as few keyframes as the bounds allow.

    Args:
        command: See `hsp_control.visualization.viewer.clip`.
        arrays: Where the numbers go.
    """
    clocks: list[Json] = []
    tracks = []
    for track in command["tracks"]:
        times = np.asarray(command["clocks"][track["clock"]], float)
        values = np.asarray(track["values"], float).reshape(len(times), -1)
        times, rows, step = _keyframes(track["property"], times, values)
        clock = arrays.numbers(times, CLOCK_STEP, np.float64)
        if clock not in clocks:
            clocks.append(clock)
        packed = arrays.numbers(rows, step)
        tracks.append({**track, "clock": clocks.index(clock), "values": packed})
    return {**command, "clocks": clocks, "tracks": tracks}


def _keyframes(name: str, times: Array, values: Array) -> tuple[Array, Array, float]:
    """Return a track's keyframes: when, what, and what to round it to."""
    how = _PROPERTIES.get(name)
    if how is None or not len(times):
        return times, values, _fine(values)
    rounded = values.min(axis=0) + how.step * np.rint(
        (values - values.min(axis=0)) / how.step
    )
    rows = thin(times, values, rounded, how.between, how.deviation)
    if len(rows) > 1 and np.array_equal(rounded[rows], rounded[rows[[0] * len(rows)]]):
        rows = rows[:1]  # it never moves
    return times[rows], rounded[rows], how.step


def _fine(values: Array) -> Any:
    return max(float(np.abs(values).max(initial=0.0)), 1e-12) * 2.0**-23
