"""Numbers in few bytes: whole multiples of a step, as differences, byte by byte.

``unpack.js`` is the other half. What neighbours share vanishes in the differences, and
bytes of one weight stand together: the page's compression finds much to take out.
"""

import hashlib
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsp_control.common.arrays import Array, Indices
from hsp_control.visualization.viewer.commands import Json, typed_array

_KINDS = {
    np.dtype("f4"): "Float32Array",
    np.dtype("f8"): "Float64Array",
    np.dtype("u1"): "Uint8Array",
    np.dtype("u4"): "Uint32Array",
}
"""What JavaScript calls them."""
_MOST = 2**31


class ArrayTable:
    """The arrays of a page: each once, however often the scene uses it.

    Attributes:
        entries: What the page makes the arrays from.
    """

    def __init__(self) -> None:
        """Start with none."""
        self.entries: list[Json] = []
        self._numbers: dict[bytes, int] = {}

    def numbers(self, values: ArrayLike, step: float, dtype: Any = np.float32) -> Json:
        """Keep numbers, each within half a step, and return what stands for them.

        Args:
            values: Shape (n,) or (n, k), finite.
            step: Distance of two numbers that are told apart, positive; coarsened for a
                column that would need more than 31 bits.
            dtype: What the page makes of them: ``float32`` or ``float64``.
        """
        rows = np.asarray(values, float)
        rows = rows[:, None] if rows.ndim == 1 else rows
        offset = rows.min(axis=0) if len(rows) else np.zeros(rows.shape[1])
        spread = np.ptp(rows, axis=0) if len(rows) else np.zeros(rows.shape[1])
        steps = np.maximum(step, spread / (_MOST - 1))
        return self._keep(
            np.rint((rows - offset) / steps).astype(np.int64),
            kind=_KINDS[np.dtype(dtype)],
            offset=offset.tolist(),
            step=steps.tolist(),
        )

    def whole(self, values: NDArray[np.integer[Any]]) -> Json:
        """Keep whole numbers of shape (n,), exactly."""
        return self._keep(
            values.astype(np.int64)[:, None],
            kind=_KINDS[values.dtype],
            offset=[0.0],
            step=[1.0],
        )

    def triangles(self, triangles: Indices) -> Json:
        """Keep triangles, shape (n, 3), of vertices numbered in order of first use."""
        flat = triangles.ravel()
        unused = np.maximum.accumulate(np.concatenate([[0], flat[:-1] + 1]))
        return self._keep((unused - flat).reshape(-1, 3), kind="triangles")

    def _keep(self, whole: Indices, **about: Any) -> Json:
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
            bytes_of_it = typed_array(np.frombuffer(data, np.uint8), np.uint8)
            self.entries.append(
                {
                    "rows": rows,
                    "columns": count,
                    "width": width,
                    "bytes": bytes_of_it,
                    **about,
                }
            )
        return {"$array": self._numbers[key]}


def step_of(values: Array, bits: int) -> float:
    """Return the step that tells 2**bits values apart over the widest column."""
    spread = float(np.ptp(values, axis=0).max()) if values.size else 0.0
    return spread / (2**bits - 1) or 1.0
