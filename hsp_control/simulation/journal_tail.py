"""Reads a journal while it is written: the rows of a loop in another process."""

import json
from pathlib import Path
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LogError
from hsp_control.simulation.journal import (
    END,
    FRAME,
    HEADING,
    MAGIC,
    ROW,
    frame_at,
)

_KEPT = 1000
"""Rows that are kept."""


class JournalTail:
    """The last rows of a journal that still grows."""

    def __init__(self, path: Path) -> None:
        """Begin; the file may appear later."""
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
        """Return the columns from a row on, as far as they are kept.

        Rows before the heading of the last one are not: their columns were others.
        """
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
