"""``hsp_step.h`` in Python, by ctypes: for tests of its refusals."""

import ctypes
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from hsp_control.frozen import library

BRAKING, HOLDING, STOPPED = 5, 6, -10
OK, WRONG_STATE, WRONG_CLOCK, NOT_FINITE, BUSY = 0, -1, -2, -3, -4
WRONG_NAME, WRONG_SIZE, WRONG_VALUE, TOO_MANY, FAILED = -5, -6, -7, -8, -9
_HEADER = 8 + 4
"""Bytes before those in the checksum."""


class PortOfC(ctypes.Structure):
    """The struct hsp_port."""

    _fields_ = (
        ("name", ctypes.c_char_p),
        ("unit", ctypes.c_char_p),
        ("meaning", ctypes.c_char_p),
        ("size", ctypes.c_size_t),
        ("is_input", ctypes.c_int),
    )


def _loaded() -> Any:
    lib = ctypes.CDLL(str(library()))
    handle, number, text = ctypes.c_void_p, ctypes.c_double, ctypes.c_char_p
    numbers, size = ctypes.c_void_p, ctypes.c_size_t
    for name, result, *arguments in (
        ("hsp_open", handle, text),
        ("hsp_close", None, handle),
        ("hsp_size_q", size, handle),
        ("hsp_size_v", size, handle),
        ("hsp_period", number, handle),
        ("hsp_step", ctypes.c_int, handle, number, numbers, numbers, numbers),
        ("hsp_stop", ctypes.c_int, handle, number, numbers, numbers, numbers),
        ("hsp_restart", ctypes.c_int, handle),
        ("hsp_port_at", ctypes.POINTER(PortOfC), handle, size),
        ("hsp_port_of", ctypes.POINTER(PortOfC), handle, text),
        ("hsp_get", ctypes.c_int, handle, text, numbers, size),
        ("hsp_set", ctypes.c_int, handle, text, numbers, size),
        ("hsp_ramp", ctypes.c_int, handle, text, numbers, size, number),
        ("hsp_last_error", text, handle),
        ("hsp_status_text", text, ctypes.c_int),
        ("hsp_build", text),
    ):
        function = getattr(lib, name)
        function.restype, function.argtypes = result, arguments
    return lib


LIB = _loaded()


def pointer(x: NDArray[np.float64] | None) -> Any:
    return None if x is None else x.ctypes.data


class Opened:
    """A handle of a frozen controller."""

    def __init__(self, file: Path) -> None:
        self.handle = LIB.hsp_open(str(file).encode())
        if not self.handle:
            raise RuntimeError(LIB.hsp_last_error(None).decode(errors="replace"))
        self.tau = np.full(LIB.hsp_size_v(self.handle), np.nan)

    def __del__(self) -> None:
        LIB.hsp_close(self.handle)

    def step(self, t: float, q: ArrayLike, v: ArrayLike) -> int:
        q_in, v_in = np.array(q, dtype=float), np.array(v, dtype=float)
        given = pointer(q_in), pointer(v_in), pointer(self.tau)
        return int(LIB.hsp_step(self.handle, t, *given))

    def stop(self, t: float, q: ArrayLike, v: ArrayLike) -> int:
        q_in, v_in = np.array(q, dtype=float), np.array(v, dtype=float)
        given = pointer(q_in), pointer(v_in), pointer(self.tau)
        return int(LIB.hsp_stop(self.handle, t, *given))

    def get(self, name: str, size: int) -> NDArray[np.float64]:
        values = np.zeros(size)
        status = LIB.hsp_get(self.handle, name.encode(), pointer(values), size)
        if status:
            raise ValueError(status)
        return values

    def ramp(self, name: str, values: ArrayLike, duration: float) -> int:
        given = np.array(values, dtype=float).ravel()
        size = len(given)
        args = self.handle, name.encode(), pointer(given), size, duration
        return int(LIB.hsp_ramp(*args))

    def set(self, name: str, values: ArrayLike) -> int:
        given = np.array(values, dtype=float).ravel()
        args = self.handle, name.encode(), pointer(given), len(given)
        return int(LIB.hsp_set(*args))

    @property
    def error(self) -> str:
        return str(LIB.hsp_last_error(self.handle).decode())

    @property
    def ports(self) -> dict[str, PortOfC]:
        found = {}
        while port := LIB.hsp_port_at(self.handle, len(found)):
            found[port.contents.name.decode()] = port.contents
        return found


def summed(content: bytes) -> bytes:
    """Return a file's content with its checksum updated."""
    body = content[_HEADER:]
    return content[:8] + zlib.crc32(body).to_bytes(4, "little") + body


class Layout:
    """Offsets in the content of a file."""

    def __init__(self, content: bytes) -> None:
        self._content = content
        (build,) = struct.unpack_from("=I", content, _HEADER)
        at = _HEADER + 4 + build
        (size,) = struct.unpack_from("=Q", content, at)
        self.memory = at + 8
        self.objects = self.memory + size

    def place(self, kind: str, name: str, rank: int = 1) -> int:
        """Return the offset of an array's descriptor in the first call of a kind.

        Args:
            kind: The kind.
            name: The argument's name.
            rank: The array's rank.
        """
        content = self._content
        call = content.index(_text(kind), self.objects)
        return content.index(_text(name), call) + 4 + len(name) + 8 * rank

    def array(self, kind: str, name: str, rank: int = 1) -> int:
        """Return the offset of an array's first entry."""
        at = self.place(kind, name, rank)
        (offset,) = struct.unpack_from("=Q", self._content, at)
        return self.memory + int(offset)


def _text(text: str) -> bytes:
    return struct.pack("=I", len(text)) + text.encode()
