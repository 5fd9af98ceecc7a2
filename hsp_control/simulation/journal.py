"""A log that is written row by row, so that no complete row is lost if a process dies.

An ``.npz`` is written only when a run is over. A journal is appended to. It is the line
`MAGIC`, then frames, each of

    kind     1 byte: H a heading, R a row, E the end
    length   4 bytes, of the payload
    check    4 bytes, CRC-32 of kind and payload
    payload

all little-endian. A heading is JSON: the log's meta data and the shape of every column.
A new heading is written whenever columns are added or grow. A row is the columns'
numbers in the order of the heading. The end is JSON: the status of the run and more.
Each frame is one `write`. After that the operating system has it, and a killed process
loses nothing that it wrote. Reading stops at the first incomplete frame.
"""

import json
import math
import os
import struct
import zlib
from collections.abc import Iterator, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LogError

MAGIC = b"hsp_control journal 1\n"
KILLED = "the journal has no end: its writer was killed"

FRAME = struct.Struct("<cII")
HEADING, ROW, END = b"H", b"R", b"E"


class JournalWriter:
    """Writes a journal."""

    def __init__(self, path: Path) -> None:
        """Begin a journal; an existing file is overwritten."""
        self.path = path  # the file
        self._shapes: dict[str, tuple[int, ...]] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_WRONLY | os.O_CREAT | os.O_TRUNC | os.O_APPEND
            self._file = os.open(path, flags, 0o644)
            self._put(MAGIC)
            self._size = len(MAGIC)
        except OSError as error:
            raise self._failure(error) from error

    def describes(self, columns: Mapping[str, Array]) -> bool:
        """Return whether the last heading fits these columns, (rows, ...) each."""
        return self._shapes == {name: a.shape[1:] for name, a in columns.items()}

    def write_heading(
        self, columns: Mapping[str, Array], meta: Mapping[str, Any]
    ) -> None:
        """Write a heading for the next rows."""
        shapes = {name: a.shape[1:] for name, a in columns.items()}
        self._frame(HEADING, _json({"columns": shapes, "meta": meta}))
        self._shapes = shapes  # only now: Ctrl-C may cut the heading short

    def write_row(self, columns: Mapping[str, Array]) -> None:
        """Write the first row of columns that fit the last heading."""
        row = np.concatenate([columns[name][0].ravel() for name in self._shapes])
        self._frame(ROW, row.astype("<f8").tobytes())

    def write_end(self, status: str, message: str, **meta: Any) -> None:
        """Write how the run ended, and meta data that replaces the heading's."""
        self._frame(END, _json({"status": status, "message": message, **meta}))

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def _frame(self, kind: bytes, payload: bytes) -> None:
        """Write a frame, whole or not at all: what cuts it short takes it back."""
        check = zlib.crc32(payload, zlib.crc32(kind))
        data = FRAME.pack(kind, len(payload), check) + payload
        try:
            self._put(data)
            self._size += len(data)
        except BaseException as error:
            with suppress(OSError):
                os.ftruncate(self._file, self._size)
            if isinstance(error, OSError):
                raise self._failure(error) from error
            raise

    def _put(self, data: bytes) -> None:
        while data:  # a nearly full disk may take only a part
            data = data[os.write(self._file, data) :]

    def _failure(self, error: OSError) -> LogError:
        reason = error.strerror or str(error)
        return LogError(f"{self.path}: cannot write the journal: {reason}")


def is_journal(path: Path) -> bool:
    """Return whether a file is a journal, by its content, not by its name."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def read_journal(path: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns and the meta data of a journal, up to an incomplete frame."""
    meta: dict[str, Any] = {}
    parts: list[_Part] = []
    end: dict[str, Any] = {"status": "interrupted", "message": KILLED}
    for kind, payload in _frames(path.read_bytes()):
        if kind == HEADING:
            heading = json.loads(payload)
            meta = heading["meta"]
            columns = heading["columns"]
            parts.append(({name: tuple(shape) for name, shape in columns.items()}, []))
        elif kind == ROW and parts:
            parts[-1][1].append(np.frombuffer(payload, "<f8"))
        elif kind == END:
            end = json.loads(payload)
    if not parts:
        raise LogError(f"{path}: the journal ends before its first heading")
    return _joined(parts), {**meta, **end}


_Part = tuple[dict[str, tuple[int, ...]], list[Array]]
"""The shapes of a heading's columns, and its rows."""


def _frames(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Yield kind and payload of every frame before the first incomplete one."""
    at = len(MAGIC)
    while (frame := frame_at(data, at)) is not None:
        yield frame
        at += FRAME.size + len(frame[1])


def frame_at(data: bytes, at: int) -> tuple[bytes, bytes] | None:
    """Return kind and payload of the frame at a place; None if it is incomplete."""
    if at + FRAME.size > len(data):
        return None
    kind, length, check = FRAME.unpack_from(data, at)
    payload = data[at + FRAME.size : at + FRAME.size + length]
    if len(payload) < length or zlib.crc32(payload, zlib.crc32(kind)) != check:
        return None
    return kind, payload


def _joined(parts: list[_Part]) -> dict[str, Array]:
    """Return the columns of all parts."""
    count = sum(len(rows) for _, rows in parts)
    final: dict[str, tuple[int, ...]] = {}
    for shapes, _ in [part for part in parts if part[1]] or parts[:1]:
        for name, shape in shapes.items():
            final[name] = tuple(map(max, final.get(name, shape), shape))
    columns = {name: np.full((count, *shape), np.nan) for name, shape in final.items()}
    begin = 0
    for shapes, rows in parts:
        if not rows:
            continue
        end = begin + len(rows)
        stacked = np.array(rows)
        at = 0
        for name, shape in shapes.items():
            size = math.prod(shape)
            where = (slice(begin, end), *(slice(length) for length in shape))
            block = stacked[:, at : at + size].reshape(len(rows), *shape)
            columns[name][where] = block
            at += size
        begin = end
    return columns


def _json(data: Any) -> bytes:
    return json.dumps(data, ensure_ascii=False).encode()


_KEPT = 1000
"""Rows that are kept."""


class JournalTail:
    """The last rows of a journal that still grows."""

    def __init__(self, path: Path) -> None:
        self.path = path  # the journal
        # the meta data of the last heading; those of the end once it is there
        self.meta: dict[str, Any] = {}
        self.count = 0  # the rows that were read
        self._read = len(MAGIC)
        self._shapes: dict[str, tuple[int, ...]] = {}
        self._next_shapes: dict[str, tuple[int, ...]] | None = None
        self._rows: list[Array] = []

    @property
    def ended(self) -> bool:
        """Whether the writer has written its end."""
        return "status" in self.meta and self.meta["status"] != "running"

    def read(self) -> int:
        """Read the frames that have come; return how many rows there are of them."""
        before = self.count
        try:
            data = self._new_bytes()
        except OSError as error:
            raise LogError(f"{self.path}: cannot be read: {error.strerror}") from error
        at = 0
        while (frame := frame_at(data, at)) is not None:
            kind, payload = frame
            at += FRAME.size + len(payload)
            if kind == HEADING:
                heading = json.loads(payload)
                self.meta = heading["meta"]
                columns = heading["columns"]
                self._next_shapes = {n: tuple(s) for n, s in columns.items()}
            elif kind == ROW:
                if self._next_shapes is not None:  # only now: the last row stays there
                    self._shapes, self._next_shapes = self._next_shapes, None
                    self._rows.clear()
                self._rows.append(np.frombuffer(payload, "<f8"))
                self.count += 1
            elif kind == END:
                self.meta = {**self.meta, **json.loads(payload)}
        self._read += at
        del self._rows[:-_KEPT]
        return self.count - before

    def rows(self, first: int) -> dict[str, Array]:
        """Return the columns from a row on, as far as they are kept."""
        wanted = max(self.count - first, 0)
        kept = self._rows[max(len(self._rows) - wanted, 0) :] if wanted else []
        width = sum(int(np.prod(shape)) for shape in self._shapes.values())
        block = np.array(kept).reshape(len(kept), width)
        ends = np.cumsum([int(np.prod(shape)) for shape in self._shapes.values()])
        parts = np.split(block, ends[:-1], axis=1) if len(ends) else []
        return {
            name: part.reshape(len(kept), *shape)
            for (name, shape), part in zip(self._shapes.items(), parts, strict=True)
        }

    def _new_bytes(self) -> bytes:
        if not self.path.exists():
            return b""
        with self.path.open("rb") as file:
            if self._read == len(MAGIC):
                beginning = file.read(len(MAGIC))
                if not MAGIC.startswith(beginning):
                    raise LogError(f"{self.path} is no journal")
            file.seek(self._read)
            return file.read()
