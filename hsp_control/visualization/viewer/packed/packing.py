"""Packs arrays of numbers into few bytes; ``unpack.js`` unpacks them.

Numbers become integer multiples of a step. Differences of neighbours are stored, byte
plane by byte plane, because the page's gzip then compresses them well.
"""

import hashlib
from typing import Any

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

    def triangles(self, triangles: Indices) -> Json:
        """Store triangles, shape (n, 3); vertices must be numbered by first use."""
        flat = triangles.ravel()
        unused = np.maximum.accumulate(np.concatenate([[0], flat[:-1] + 1]))
        return self._store((unused - flat).reshape(-1, 3), kind="triangles")

    def _store(self, whole: Indices, **about: Any) -> Json:
        differences = whole
        if about["kind"] != "triangles":
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
