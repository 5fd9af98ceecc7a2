"""The journal of a log: rows are appended at once, so that a killed run loses none.

An ``.npz`` has all rows of a column in one place and its directory at the end, so it
can only be written when a run is over. Until then the rows are in a file that is only
appended to: the line `MAGIC`, then frames of

    kind     1 byte: H a heading, R a row, N a note, E the end
    length   4 bytes, of the payload
    check    4 bytes, CRC-32 of kind and payload
    payload

all little-endian. A heading is JSON: the log's meta data and the shape of every column;
another one follows when columns are added or grow. No row can be read without the first
one, so a copy follows it, and a reader uses whichever is whole; a journal without the
copy, as was written once, is as valid. A row is the columns' numbers in
the order of the heading. The end is JSON: the status of the run and more. A note is
JSON of another kind: a sweep's journal has one per run.
A frame is one `write`. After that the operating system has it, and a killed process
loses nothing that it wrote. Reading stops at an incomplete frame at the end. A damaged
frame is left out; if its length is damaged, the next whole frame is searched.
"""

import fcntl
import json
import math
import os
import re
import struct
import zlib
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any
from weakref import WeakSet

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError
from hsp_control.common.regular_file import why_endless
from hsp_control.common.unicode_text import json_text

MAGIC = b"hsp_control journal 1\n"
KILLED = "the journal has no end: its writer was killed"

MOST_AXES = 16
"""Maximum number of axes of a column; NumPy's arrays have at most 32 or 64."""
LARGEST_ROW = 100_000_000
"""Most bytes of a row; a heading that declares more is none."""

_FRAME = struct.Struct("<cII")
_KINDS = re.compile(b"[HRNE]")
_LARGEST_SEARCH = 1_000_000_000
"""Most bytes whose check is computed in the search for a whole frame."""
_HEADING, _ROW, _NOTE, _END = b"H", b"R", b"N", b"E"

Shapes = Mapping[str, tuple[int, ...]]
"""The shapes of columns in one row."""


_writers: "WeakSet[JournalWriter]" = WeakSet()
"""The journals that this process writes."""


class JournalWriter:
    """Writes a journal; no other writer can, until it is closed or deleted."""

    def __init__(self, path: Path, resumed: "JournalReader | None" = None) -> None:
        """Begin a journal, or continue after the rows that a reader has read.

        Else an existing file is overwritten, unless another process writes it.
        """
        self.path = path  # the file
        self._file = -1
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            flags = os.O_RDWR | os.O_CREAT | os.O_APPEND
            self._file = os.open(path, flags, 0o644)
        except (OSError, ValueError) as error:
            raise self._failure(error) from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            kept = 0 if resumed is None else resumed.whole()
            os.ftruncate(self._file, kept)
            if not kept:
                self._put(MAGIC)
            self._size = kept or len(MAGIC)
            self._begins = not kept
        except BaseException as error:
            self.close()
            if isinstance(error, OSError):
                raise self._failure(error) from error
            raise
        _writers.add(self)

    def write_heading(self, shapes: Shapes, meta: Mapping[str, Any]) -> None:
        """Write a heading for the next rows; the first one, which all need, twice."""
        payload = _json({"columns": shapes, "meta": meta})
        self._frame(_HEADING, payload)
        if self._begins:
            self._frame(_HEADING, payload)
        self._begins = False

    def write_row(self, numbers: Array) -> None:
        """Write a row, shape (n,): the numbers of all columns of the last heading."""
        self._frame(_ROW, numbers.astype("<f8", copy=False).tobytes())

    def write_note(self, note: Mapping[str, Any]) -> None:
        """Write a note, JSON data."""
        self._frame(_NOTE, _json(note))

    def write_end(self, status: str, message: str, **meta: Any) -> None:
        """Write how the run ended, and meta data that replaces the heading's.

        If the file or its folder was deleted meanwhile, it is made anew.
        """
        self._frame(_END, _json({"status": status, "message": message, **meta}))
        try:
            if os.fstat(self._file).st_nlink == 0:
                self._write_again()
        except OSError as error:
            raise self._failure(error) from error

    def _write_again(self) -> None:
        """Write all that is in the deleted file to another one of its name."""
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("xb") as file:
            at = 0
            while data := os.pread(self._file, 1 << 20, at):
                file.write(data)
                at += len(data)

    def close(self) -> None:
        """Close the file; a second call does nothing."""
        if self._file >= 0:
            os.close(self._file)
            self._file = -1
            _writers.discard(self)

    def __del__(self) -> None:
        """Close the file of a writer that was not closed."""
        self.close()

    def _frame(self, kind: bytes, payload: bytes) -> None:
        """Write a frame, whole or not at all: an incomplete one is removed."""
        check = zlib.crc32(payload, zlib.crc32(kind))
        data = _FRAME.pack(kind, len(payload), check) + payload
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

    def _failure(self, error: OSError | ValueError) -> LogError:
        reason = getattr(error, "strerror", None) or str(error)
        if isinstance(error, BlockingIOError):
            reason = "another process writes it; wait for it, or give another --out"
            if any(
                writer.path.absolute() == self.path.absolute() for writer in _writers
            ):
                reason = "this program writes it already: close that log first"
        return LogError(f"{self.path}: cannot write the journal: {reason}")


class JournalReader:
    """Reads a journal, also while it grows."""

    def __init__(self, path: Path, most: int | None = None) -> None:
        """Begin at the start; of all rows only the last ``most`` are kept, if given."""
        self.path = path  # the journal
        # the meta data of the last heading; those of the end once it is there
        self.meta: dict[str, Any] = {}
        self.count = 0  # the rows that were read
        self.ended = False  # whether the writer has written its end
        self.notes: list[Any] = []  # all of them
        self.damaged = 0  # the frames that were left out
        self._most, self._at = most, len(MAGIC)
        # the bytes of the first heading's frame, once it was read
        self._heading_size: int | None = None
        self._parts: list[tuple[Shapes, list[Array]]] = []

    def read(self) -> int:
        """Read the new frames; return their number of rows.

        Raises:
            LogError: If the file is no journal, or cannot be read.
        """
        before = self.count
        for kind, payload in self._frames():
            try:
                self._take(kind, payload)
            except LogError:
                raise
            except (ValueError, KeyError, TypeError, AttributeError, RecursionError):
                what = {_HEADING: "heading", _NOTE: "note"}.get(kind, "end")
                raise LogError(
                    f"{self.path}: a {what} of the journal is invalid"
                ) from None
        return self.count - before

    def _take(self, kind: bytes, payload: bytes) -> None:
        """Process a frame."""
        if kind == _HEADING:
            heading = json.loads(payload)
            shapes = {n: tuple(s) for n, s in heading["columns"].items()}
            sizes = [size for shape in shapes.values() for size in shape]
            if not all(type(size) is int and size >= 0 for size in sizes):
                raise ValueError
            if max(map(len, shapes.values()), default=0) > MOST_AXES:
                raise ValueError
            if 8 * width(shapes) > LARGEST_ROW:
                raise LogError(
                    f"{self.path}: a row would have {8 * width(shapes):g} bytes; at "
                    f"most {LARGEST_ROW:g}"
                )
            self.meta = dict(heading["meta"])
            self._parts.append((shapes, []))
        elif kind == _ROW:
            # After a heading that was lost its rows have other lengths.
            if not self._parts or len(payload) != 8 * width(self._parts[-1][0]):
                self.damaged += 1
                return
            self._parts[-1][1].append(np.frombuffer(payload, "<f8"))
            self.count += 1
            if self._most is not None:
                del self._parts[:-1], self._parts[-1][1][: -self._most]
        elif kind == _NOTE:
            self.notes.append(json.loads(payload))
        elif kind == _END:
            self.meta, self.ended = {**self.meta, **json.loads(payload)}, True

    def whole(self) -> int:
        """Read the new bytes; return the number of bytes in complete frames."""
        self.read()
        begun = self.path.is_file() and self.path.stat().st_size >= len(MAGIC)
        return self._at if begun else 0

    def ends_damaged(self) -> bool:
        """Return whether all bytes of the frame after the last one are there.

        In a file that is no longer written it is damaged, not merely unfinished.
        """
        data = self.path.read_bytes()[self._at :]
        if len(data) < _FRAME.size:
            return False
        _, length, _ = _FRAME.unpack_from(data)
        return bool(_FRAME.size + length <= len(data))

    def rows(self, first: int) -> dict[str, Array]:
        """Return the columns from a row on, as far as they are kept."""
        kept = sum(len(rows) for _, rows in self._parts)
        return joined(self._parts, max(first - (self.count - kept), 0))

    def _frames(self) -> Iterator[tuple[bytes, bytes]]:
        """Yield kind and payload of every new frame before the first incomplete one."""
        try:
            if self.path.is_dir() or why_endless(self.path):
                raise LogError(f"{self.path} is not a journal")
            with self.path.open("rb") as file:
                if not MAGIC.startswith(file.read(len(MAGIC))):
                    raise LogError(f"{self.path} is not a journal")
                file.seek(self._at)
                data = file.read()
        except FileNotFoundError:  # its writer has not begun
            return
        except LogError:
            raise
        except (OSError, ValueError) as error:
            reason = getattr(error, "strerror", None) or str(error)
            raise LogError(f"{self.path}: cannot be read: {reason}") from error
        at = 0
        while at < len(data):
            payload = _whole_frame(data, at)
            if payload is None:
                # The last frame may still be written; others follow a damaged one.
                after = _next_frame(data, at)
                if after is None:
                    return
                # No row is lost with the first heading or its copy.
                if not self._at_heading(data, at, after):
                    self.damaged += 1
                self._at += after - at
                at = after
                continue
            kind, size = data[at : at + 1], _FRAME.size + len(payload)
            if kind == _HEADING and self._heading_size is None:
                self._heading_size = size
            at += size
            self._at += size
            yield kind, payload

    def _at_heading(self, data: bytes, at: int, after: int) -> bool:
        """Return whether a damaged frame is the first heading, or its copy.

        Then it is as long as the other one, which is before it or after it.
        """
        if self._at == len(MAGIC):
            kind, length, _ = _FRAME.unpack_from(data, after)
            return bool(kind == _HEADING and _FRAME.size + length == after - at)
        first = self._heading_size
        return after - at == first and self._at == len(MAGIC) + first


def _whole_frame(data: bytes, at: int) -> bytes | None:
    """Return the payload of the frame at a place; None if none is there."""
    if at + _FRAME.size > len(data):
        return None
    kind, length, check = _FRAME.unpack_from(data, at)
    payload = data[at + _FRAME.size : at + _FRAME.size + length]
    if len(payload) < length or zlib.crc32(payload, zlib.crc32(kind)) != check:
        return None
    return payload


def _next_frame(data: bytes, at: int) -> int | None:
    """Return where the next whole frame after a damaged one is; None if none is."""
    _, length, _ = _FRAME.unpack_from(data.ljust(at + _FRAME.size, b"\0"), at)
    expected: int = at + _FRAME.size + length
    if _whole_frame(data, expected) is not None:
        return expected
    searched = 0
    for found in _KINDS.finditer(data, at + 1):
        place = found.start()
        if place + _FRAME.size > len(data) or searched > _LARGEST_SEARCH:
            return None
        _, length, _ = _FRAME.unpack_from(data, place)
        if place + _FRAME.size + length > len(data):
            continue
        searched += length
        if _whole_frame(data, place) is not None:
            return place
    return None


def is_journal(path: Path) -> bool:
    """Return whether a file is a journal, by its content, not by its name."""
    with path.open("rb") as file:
        return file.read(len(MAGIC)) == MAGIC


def width(shapes: Shapes) -> int:
    """Return the number of values in a row."""
    return sum(map(math.prod, shapes.values()))


def views(block: Array, shapes: Shapes) -> dict[str, Array]:
    """Return the columns of rows of numbers, shape (..., n), as views of them."""
    found, at = {}, 0
    for name, shape in shapes.items():
        size = math.prod(shape)
        part = block[..., at : at + size]
        found[name] = part.reshape((*block.shape[:-1], *shape))
        at += size
    return found


def joined(
    parts: Sequence[tuple[Shapes, Sequence[Array] | Array]], skip: int = 0
) -> dict[str, Array]:
    """Return the columns of rows that follow one another, without the first ones.

    Parts have their own columns; NaN is where it lacks a number. Of one part they are
    views, if its rows are an array.
    """
    chosen = []
    for k, (shapes, rows) in enumerate(parts):
        if len(rows) > skip or k == len(parts) - 1:
            block = np.asarray(rows[skip:]).reshape(-1, width(shapes))
            chosen.append(views(block, shapes))
        skip = max(skip - len(rows), 0)
    if len(chosen) == 1:
        return chosen[0]
    largest: dict[str, tuple[int, ...]] = {}
    for columns in chosen:
        for name, values in columns.items():
            shape = values.shape[1:]
            largest[name] = tuple(map(max, largest.get(name, shape), shape))
    counts = [len(next(iter(columns.values()))) for columns in chosen]
    found = {n: np.full((sum(counts), *shape), np.nan) for n, shape in largest.items()}
    begin = 0
    for columns, count in zip(chosen, counts, strict=True):
        for name, values in columns.items():
            where = slice(begin, begin + count), *map(slice, values.shape[1:])
            found[name][where] = values
        begin += count
    return found


def _json(data: Any) -> bytes:
    return json_text(data).encode()
