"""A log that is written row by row: whatever ends the writer, all whole rows are there.

An ``.npz`` exists when a run is over, or not at all. A journal is appended to: a line
that says what it is, then frames, each of

    kind     1 byte: H a heading, R a row, E the end
    length   4 bytes, of the payload
    check    4 bytes, CRC-32 of kind and payload
    payload

all little-endian. A heading is JSON: the log's meta data and the shape of every column;
a new one stands wherever columns have come or grown. A row is the columns' numbers in
the heading's order. The end tells how the run ended. Each frame is one `write`: from
then on the operating system has it, and a killed process loses nothing that it wrote. A
frame that is torn ends the journal where it begins.
"""

import json
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LogError

MAGIC = b"hsp_control journal 1\n"
KILLED = "the journal has no end: its writer was killed"

_FRAME = struct.Struct("<cII")
_HEADING, _ROW, _END = b"H", b"R", b"E"


class JournalWriter:
    """A journal that is being written.

    Attributes:
        path: The file.
    """

    def __init__(self, path: Path) -> None:
        """Begin a journal; one that is there is overwritten.

        Raises:
            LogError: If the file cannot be written.
        """
        self.path = path
        self._shapes: dict[str, tuple[int, ...]] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND
            self._file = os.open(path, flags, 0o644)
            self._put(MAGIC)
        except OSError as error:
            raise self._failure(error) from error

    def has(self, columns: Mapping[str, Array]) -> bool:
        """Return whether the last heading describes these columns, (rows, ...) each."""
        return self._shapes == {name: a.shape[1:] for name, a in columns.items()}

    def head(self, columns: Mapping[str, Array], meta: Mapping[str, Any]) -> None:
        """Write a heading for the rows to come.

        Raises:
            LogError: If it cannot be written.
        """
        self._shapes = {name: a.shape[1:] for name, a in columns.items()}
        self._frame(_HEADING, _json({"columns": self._shapes, "meta": meta}))

    def append(self, columns: Mapping[str, Array]) -> None:
        """Write the first row of columns that the last heading describes.

        Raises:
            LogError: If it cannot be written.
        """
        row = np.concatenate([columns[name][0].ravel() for name in self._shapes])
        self._frame(_ROW, row.astype("<f8").tobytes())

    def end(self, status: str, message: str, **meta: Any) -> None:
        """Say how the run ended.

        Raises:
            LogError: If it cannot be written.
        """
        self._frame(_END, _json({"status": status, "message": message, **meta}))

    def close(self) -> None:
        """Close the file; again is no error."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _frame(self, kind: bytes, payload: bytes) -> None:
        check = zlib.crc32(payload, zlib.crc32(kind))
        try:
            self._put(_FRAME.pack(kind, len(payload), check) + payload)
        except OSError as error:
            raise self._failure(error) from error

    def _put(self, data: bytes) -> None:
        while data:  # a disk that is nearly full takes a part
            data = data[os.write(self._file, data) :]

    def _failure(self, error: OSError) -> LogError:
        reason = error.strerror or str(error)
        return LogError(f"{self.path}: cannot write the journal: {reason}")


def is_journal(path: Path) -> bool:
    """Return whether a file is a journal, whatever its name.

    Raises:
        OSError: If it cannot be read.
    """
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns and the meta data of a journal, up to its first torn frame.

    A column that came later, or was narrower at first, holds NaN before.

    Raises:
        LogError: If not even the first heading is whole.
    """
    meta: dict[str, Any] = {}
    shapes: dict[str, tuple[int, ...]] = {}
    parts: list[tuple[dict[str, tuple[int, ...]], list[Array]]] = []
    end: dict[str, Any] = {"status": "interrupted", "message": KILLED}
    for kind, payload in _frames(path.read_bytes()):
        if kind == _HEADING:
            heading = json.loads(payload)
            meta = heading["meta"]
            shapes = {name: tuple(s) for name, s in heading["columns"].items()}
            parts.append((shapes, []))
        elif kind == _ROW and parts:
            parts[-1][1].append(np.frombuffer(payload, "<f8"))
        elif kind == _END:
            end = json.loads(payload)
    if not parts:
        raise LogError(f"{path}: the journal ends before its first heading")
    return _joined(parts), {**meta, **end}


def _frames(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    at = len(MAGIC)
    while at + _FRAME.size <= len(data):
        kind, length, check = _FRAME.unpack_from(data, at)
        at += _FRAME.size
        payload = data[at : at + length]
        if len(payload) < length or zlib.crc32(payload, zlib.crc32(kind)) != check:
            return
        yield kind, payload
        at += length


def _joined(
    parts: list[tuple[dict[str, tuple[int, ...]], list[Array]]],
) -> dict[str, Array]:
    final: dict[str, tuple[int, ...]] = {}
    for shapes, _ in parts:
        for name, shape in shapes.items():
            final[name] = max(final.get(name, shape), shape)
    count = sum(len(rows) for _, rows in parts)
    columns = {name: np.full((count, *shape), np.nan) for name, shape in final.items()}
    begin = 0
    for shapes, rows in parts:
        if not rows:
            continue
        end = begin + len(rows)
        stacked = np.array(rows)
        at = 0
        for name, shape in shapes.items():
            size = int(np.prod(shape))
            where = (slice(begin, end), *(slice(length) for length in shape))
            block = stacked[:, at : at + size].reshape(len(rows), *shape)
            columns[name][where] = block
            at += size
        begin = end
    return columns


def _json(data: Any) -> bytes:
    return json.dumps(data, ensure_ascii=False).encode()
