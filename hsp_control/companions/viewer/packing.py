"""Packs arrays of numbers, clips and curves into few bytes."""

import hashlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsp_control.common.arrays import Array, Indices
from hsp_control.companions.viewer.commands import Json, typed_array

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


def keyframe_rows(
    times: Array, samples: Array, rounded: Array, bound: float
) -> Indices:
    """Return the rows of a curve's keyframes (Douglas and Peucker 1973).

    All segments whose worst sample is off by more than the bound are split there, at
    once. All shapes (n,).
    """
    rows = np.arange(len(times))
    keys = np.unique([0, len(times) - 1])
    while len(keys) < len(times):
        segment = np.clip(np.searchsorted(keys, rows, side="right") - 1, 0, None)
        errors = np.abs(samples - np.interp(times, times[keys], rounded[keys]))
        errors[keys] = 0.0  # at a keyframe, only the rounding error is left
        worst = np.maximum.reduceat(errors, keys)
        first = np.flatnonzero((errors == worst[segment]) & (errors > bound))
        if not len(first):
            break
        _, first_of_each = np.unique(segment[first], return_index=True)
        keys = np.union1d(keys, first[first_of_each])
    return keys


_STEPS = {
    "position": 2.5e-5,
    "quaternion": 2.0**-15,
    "scale": 2.5e-5,
    "color": 1 / 1024,
    "visible": 1.0,
    "length": 1 / 64,
}
"""Resolution of what a track plays."""


def reduce_clip(command: Json, arrays: ArrayTable) -> Json:
    """Return a clip's command in few bytes; what stays the same has one row."""
    clocks: list[Json] = []
    tracks = []
    for track in command["tracks"]:
        times = np.asarray(command["clocks"][track["clock"]], float)
        values = np.asarray(track["values"], float).reshape(len(times), -1)
        step = _STEPS[track["property"]]
        if len(times) and np.ptp(values, axis=0).max() < 0.5 * step:
            times, values = times[:1], values[:1]
        clock = arrays.numbers(times, CLOCK_STEP, np.float64)
        if clock not in clocks:
            clocks.append(clock)
        packed = arrays.numbers(values, step)
        tracks.append({**track, "clock": clocks.index(clock), "values": packed})
    return {**command, "clocks": clocks, "tracks": tracks}
