"""Reduces a clip to few keyframes, with a bounded error at every sample."""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.packed.keyframes import (
    RelativeError,
    angle_error,
    distance_error,
    hold,
    keyframe_rows,
    linear,
    slerp,
)
from hsp_control.visualization.viewer.packed.packing import CLOCK_STEP, ArrayTable

POSITION_BOUND = 2e-4  # maximum position error of a node [m]
ANGLE_BOUND = np.radians(0.1)  # maximum rotation error of a node [rad]


class _Property(NamedTuple):
    """How a property is interpolated, and its error bound."""

    step: float  # the resolution of its values
    # The player's interpolation between two keyframes: ``player.js``.
    interpolate: Callable[[Array, Array, Array], Array]
    error: RelativeError  # above 1 where the error exceeds its bound


_PROPERTIES = {
    "position": _Property(POSITION_BOUND / 8, linear, distance_error(POSITION_BOUND)),
    "quaternion": _Property(2.0**-15, slerp, angle_error(ANGLE_BOUND)),
    "scale": _Property(POSITION_BOUND / 8, linear, distance_error(POSITION_BOUND)),
    "color": _Property(1 / 1024, linear, distance_error(1 / 256)),
    "opacity": _Property(1 / 1024, linear, distance_error(1 / 256)),
    "visible": _Property(1.0, hold, distance_error(0.5)),
    "length": _Property(1 / 64, linear, distance_error(0.25)),
}
"""All keyframes of a property that is not listed are kept."""


def reduce_clip(command: Json, arrays: ArrayTable) -> Json:
    """Return a clip's command with as few keyframes as the bounds allow."""
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
    """Return a track's keyframes: times, values, and the resolution of the values."""
    prop = _PROPERTIES.get(name)
    if prop is None or not len(times):
        return times, values, _float32_step(values)
    rounded = values.min(axis=0) + prop.step * np.rint(
        (values - values.min(axis=0)) / prop.step
    )
    rows = keyframe_rows(times, values, rounded, prop.interpolate, prop.error)
    if len(rows) > 1 and np.array_equal(rounded[rows], rounded[rows[[0] * len(rows)]]):
        rows = rows[:1]  # it is constant
    return times[rows], rounded[rows], prop.step


def _float32_step(values: Array) -> Any:
    """Return the resolution of float32 at the largest value."""
    return max(float(np.abs(values).max(initial=0.0)), 1e-12) * 2.0**-23
