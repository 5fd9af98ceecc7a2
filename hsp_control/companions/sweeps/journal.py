"""The journal: finished rows in their order of arrival, safe if the process is killed.

Rows cannot be appended to a Parquet file, so they are written to a text file beside it,
one line of JSON per row. They are no log: a row is a run, with its status in words and
metrics that differ from run to run, not numbers of one layout. A process that is killed
while writing leaves an incomplete line; reading ignores it, and the next writing
removes it.
"""

import fcntl
import json
import os
from dataclasses import asdict
from pathlib import Path
from typing import Any, TextIO

from hsp_control.common.exceptions import SweepError
from hsp_control.companions.sweeps.row import SweepRow
from hsp_control.simulation.measures import Measure


def journal_of(out: Path) -> Path:
    """Return the path of a sweep's journal."""
    return out.with_name(f"{out.name}.journal")


class Journal:
    """A file of finished runs, open for appending by only one process.

    Attributes:
        path: The file.
        identity: The identity of its sweep; None for a new journal.
        rows: The rows that it contained when it was opened.
        described: Units and meanings of the metrics in these rows.
    """

    def __init__(self, path: Path) -> None:
        """Open a journal, or create one."""
        self.path = path
        self.identity: dict[str, Any] | None = None
        self.rows: list[SweepRow] = []
        self.described: dict[str, Measure] = {}
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            self._file: TextIO = path.open("a+", encoding="utf-8")
        except OSError as error:
            reason = error.strerror or str(error)
            raise SweepError(f"{path}: cannot be written: {reason}") from error
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            self._file.close()
            raise SweepError(
                f"{path}: another process is writing this sweep; wait for it, or give "
                "another --out"
            ) from None
        try:
            self._read()
        except (ValueError, KeyError, TypeError, AttributeError) as error:
            self._file.close()
            raise SweepError(
                f"{path}: not the journal of a sweep ({error}); remove it, or give "
                "another --out"
            ) from None

    def begin(self, identity: dict[str, Any]) -> None:
        """Empty the journal, and write the identity of its sweep."""
        self._file.truncate(0)
        self.identity, self.rows, self.described = identity, [], {}
        self._write({"sweep": identity})

    def add(self, row: SweepRow, found: dict[str, Measure]) -> None:
        """Append a row; when this returns, the operating system has the data."""
        new = {name: m for name, m in found.items() if name not in self.described}
        if new:
            self.described |= new
            self._write({"described": {name: [*m[1:]] for name, m in new.items()}})
        self._write({"row": asdict(row)})

    def close(self) -> None:
        """Close the file; a sweep can resume from it."""
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def remove(self) -> None:
        """Close and delete the file, after its rows were saved elsewhere."""
        self._file.close()
        self.path.unlink(missing_ok=True)

    def _write(self, entry: dict[str, Any]) -> None:
        self._file.write(json.dumps(entry) + "\n")
        self._file.flush()

    def _read(self) -> None:
        """Read the complete lines, and remove an incomplete last line."""
        self._file.seek(0)
        text = self._file.read()
        whole = text[: text.rfind("\n") + 1]
        for line in whole.splitlines():
            entry = json.loads(line)
            if "sweep" in entry:
                self.identity = dict(entry["sweep"])
            elif "described" in entry:
                for name, (unit, meaning) in entry["described"].items():
                    self.described[name] = Measure(0.0, unit, meaning)
            else:
                self.rows.append(SweepRow(**entry["row"]))
        beginning = '{"sweep": '
        if not whole and not beginning.startswith(text[: len(beginning)]):
            raise ValueError("its first line has another format")
        if len(whole) < len(text):
            self._file.truncate(len(whole.encode()))
