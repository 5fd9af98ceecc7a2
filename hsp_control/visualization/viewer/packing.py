"""Packs arrays of numbers, and clips as few keyframes, into few bytes."""

import hashlib
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsp_control.common.arrays import Array, Indices
from hsp_control.visualization.viewer.commands import Json, typed_array

CLOCK_STEP = 1e-6  # resolution of times [s]
_KINDS = {
    np.dtype("f4"): "Float32Array",
    np.dtype("f8"): "Float64Array",
    np.dtype("u1"): "Uint8Array",
    np.dtype("u4"): "Uint32Array",
}
"""Names of the types in JavaScript."""
_MAX_STEPS = 2**31


class ArrayTable:
    """The arrays of a page; equal arrays are stored once."""

    def __init__(self) -> None:
        """Start without arrays."""
        self.entries: list[Json] = []
        self._numbers: dict[bytes, int] = {}

    def numbers(self, values: ArrayLike, step: float, dtype: Any = np.float32) -> Json:
        """Store numbers to within half a step; return a reference to the array."""
        rows = np.asarray(values, float)
        rows = rows[:, None] if rows.ndim == 1 else rows
        offset = rows.min(axis=0) if len(rows) else np.zeros(rows.shape[1])
        spread = np.ptp(rows, axis=0) if len(rows) else np.zeros(rows.shape[1])
        steps = np.maximum(step, spread / (_MAX_STEPS - 1))
        return self._store(
            np.rint((rows - offset) / steps).astype(np.int64),
            kind=_KINDS[np.dtype(dtype)],
            offset=offset.tolist(),
            step=steps.tolist(),
        )

    def whole(self, values: NDArray[np.integer[Any]]) -> Json:
        """Store integers of shape (n,) exactly; return a reference to the array."""
        return self._store(
            values.astype(np.int64)[:, None],
            kind=_KINDS[values.dtype],
            offset=[0.0],
            step=[1.0],
        )

    def _store(self, whole: Indices, **about: Any) -> Json:
        differences = np.diff(whole, axis=0, prepend=0)
        zigzag = (differences << 1) ^ (differences >> 63)
        largest = int(zigzag.max(initial=0))
        width = next(n for n in range(1, 9) if largest < 256**n)
        columns = np.ascontiguousarray(zigzag.T, "<u8")
        planes = columns.view(np.uint8).reshape(*columns.shape, 8)[..., :width]
        data = np.ascontiguousarray(np.moveaxis(planes, -1, 0)).tobytes()
        rows, count = whole.shape
        head = repr((rows, count, width, sorted(about.items()))).encode()
        key = hashlib.sha256(head + data).digest()
        if key not in self._numbers:
            self._numbers[key] = len(self.entries)
            packed = typed_array(np.frombuffer(data, np.uint8), np.uint8)
            self.entries.append(
                {
                    "rows": rows,
                    "columns": count,
                    "width": width,
                    "bytes": packed,
                    **about,
                }
            )
        return {"$array": self._numbers[key]}


def step_of(values: Array, bits: int) -> float:
    """Return the step that divides the widest column into 2**bits values."""
    spread = float(np.ptp(values, axis=0).max()) if values.size else 0.0
    return spread / (2**bits - 1) or 1.0


RelativeError = Callable[[Array, Array], Array]
"""Error between samples (n, k) and played values (n, k), over its bound: shape (n,)."""


def keyframe_rows(
    times: Array,
    samples: Array,
    rounded: Array,
    interpolate: Callable[[Array, Array, Array], Array],
    error: RelativeError,
) -> Indices:
    """Return the rows of the keyframes, by the algorithm of Douglas and Peucker (1973).

    All segments whose worst sample exceeds the bound are split there, at once.
    ``times`` (n,), ``samples`` and ``rounded`` (n, k).
    """
    last = len(times) - 1
    rows = np.arange(len(times))
    keys = np.unique([0, last])
    while len(keys) < len(times):
        segment = np.clip(np.searchsorted(keys, rows, side="right") - 1, 0, None)
        left = keys[segment]
        right = keys[np.minimum(segment + 1, len(keys) - 1)]
        length = times[right] - times[left]
        fraction = (times - times[left]) / np.where(length > 0.0, length, 1.0)
        played = interpolate(rounded[left], rounded[right], fraction[:, None])
        errors = error(samples, played)
        errors[keys] = 0.0  # at a keyframe, only the rounding error is left
        worst = np.maximum.reduceat(errors, keys)
        first = np.flatnonzero((errors == worst[segment]) & (errors > 1.0))
        if not len(first):
            break
        _, first_of_each = np.unique(segment[first], return_index=True)
        keys = np.union1d(keys, first[first_of_each])
    return keys


def linear(left: Array, right: Array, fraction: Array) -> Array:
    """Interpolate linearly from left to right."""
    return left + fraction * (right - left)


def slerp(left: Array, right: Array, fraction: Array) -> Array:
    """Interpolate unit quaternions spherically, the short way from left to right."""
    cosine = np.sum(left * right, axis=1, keepdims=True)
    right = np.where(cosine < 0.0, -right, right)
    angle = np.arccos(np.clip(np.abs(cosine), 0.0, 1.0))
    sine = np.sin(angle)
    near = sine < 1e-6
    sine = np.where(near, 1.0, sine)
    a = np.where(near, 1.0 - fraction, np.sin((1.0 - fraction) * angle) / sine)
    b = np.where(near, fraction, np.sin(fraction * angle) / sine)
    mixed = a * left + b * right
    return np.asarray(mixed / np.linalg.norm(mixed, axis=1, keepdims=True))


def hold(left: Array, right: Array, fraction: Array) -> Array:
    """Hold the left value until the right keyframe is reached."""
    return np.where(fraction >= 1.0, right, left)


def distance_error(bound: float) -> RelativeError:
    """Return the error function: Euclidean distance over a bound."""
    return lambda samples, played: np.linalg.norm(samples - played, axis=1) / bound


def angle_error(bound: float) -> RelativeError:
    """Return the error function: angle between quaternions over a bound [rad]."""

    def error(samples: Array, played: Array) -> Array:
        # |a - b| = 2 sin(angle / 4): well conditioned near zero, as arccos is not.
        ends = np.stack([samples - played, samples + played])
        chord = np.linalg.norm(ends, axis=2).min(axis=0)
        return np.asarray(4.0 * np.arcsin(np.clip(0.5 * chord, 0.0, 1.0)) / bound)

    return error


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
        # The resolution of float32 at the largest value.
        return times, values, max(np.abs(values).max(initial=0.0), 1e-12) * 2.0**-23
    rounded = values.min(axis=0) + prop.step * np.rint(
        (values - values.min(axis=0)) / prop.step
    )
    rows = keyframe_rows(times, values, rounded, prop.interpolate, prop.error)
    if len(rows) > 1 and np.array_equal(rounded[rows], rounded[rows[[0] * len(rows)]]):
        rows = rows[:1]  # it is constant
    return times[rows], rounded[rows], prop.step
