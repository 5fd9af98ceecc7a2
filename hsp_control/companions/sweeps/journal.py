"""A sweep's journal: its finished runs as they came, safe if the process is killed.

A Parquet file can only be written when all is over. Until then a journal beside it, as
a run's log has one, gets a note for each run: its status in words, and its metrics,
which differ from run to run.
"""

from dataclasses import asdict
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import SweepError
from hsp_control.companions.sweeps.row import SweepRow
from hsp_control.simulation.journal import JournalReader, JournalWriter
from hsp_control.simulation.measures import Measure


def journal_of(out: Path) -> Path:
    """Return the path of a sweep's journal."""
    return out.with_name(f"{out.name}.journal")


class SweepJournal:
    """A file of finished runs, open for appending by only one process.

    Attributes:
        path: The file.
        identity: The identity of its sweep; None for a new journal.
        rows: The rows that it contained when it was opened.
        described: Units and meanings of the metrics in these rows.
    """

    def __init__(self, path: Path, *, fresh: bool) -> None:
        """Open a journal, or create one; a fresh one is empty.

        Raises:
            LogError: If it cannot be written, or is no journal.
            SweepError: If it is the journal of a run.
        """
        self.path = path
        self.identity: dict[str, Any] | None = None
        self.rows: list[SweepRow] = []
        self.described: dict[str, Measure] = {}
        earlier = JournalReader(path)
        earlier.read()
        if earlier.meta:
            raise SweepError(f"{path}: the journal of a run; give another --out")
        self._writer = JournalWriter(path, None if fresh else earlier)
        for note in () if fresh else earlier.notes:
            if "sweep" in note:
                self.identity = note["sweep"]
            elif "described" in note:
                for name, (unit, meaning) in note["described"].items():
                    self.described[name] = Measure(0.0, unit, meaning)
            else:
                self.rows.append(SweepRow(**note["row"]))

    def begin(self, identity: dict[str, Any]) -> None:
        """Write the identity of the sweep."""
        self._writer.write_note({"sweep": identity})

    def add(self, row: SweepRow, found: dict[str, Measure]) -> None:
        """Append a row; when this returns, the operating system has the data."""
        new = {name: m for name, m in found.items() if name not in self.described}
        if new:
            self.described |= new
            described = {name: [*m[1:]] for name, m in new.items()}
            self._writer.write_note({"described": described})
        self._writer.write_note({"row": asdict(row)})

    def close(self) -> None:
        """Close the file; a sweep can resume from it."""
        self._writer.close()

    def remove(self) -> None:
        """Close and delete the file, after its rows were saved elsewhere."""
        self.close()
        self.path.unlink(missing_ok=True)
