"""The store of a sweep's rows, from the first run to the finished file."""

import json
from pathlib import Path
from typing import Any

from hsp_control.common.exceptions import SweepError
from hsp_control.companions.sweeps.journal import SweepJournal, journal_of
from hsp_control.companions.sweeps.parquet import require_parquet
from hsp_control.companions.sweeps.plan import SweepPlan
from hsp_control.companions.sweeps.results import Sweep
from hsp_control.companions.sweeps.row import CRASHED, TIMED_OUT, SweepRow
from hsp_control.declaration.language import shown
from hsp_control.simulation.measures import Measure


class Store:
    """The rows of a sweep: in memory, and in its files if it has a file name.

    Attributes:
        rows: The finished rows, by run.
    """

    def __init__(
        self,
        plan: SweepPlan,
        identity: dict[str, Any],
        out: Path | None,
        *,
        fresh: bool,
    ) -> None:
        """Read the rows that the files already contain."""
        self.rows: dict[int, SweepRow] = {}
        self._described: dict[str, Measure] = {}
        self._plan, self._identity, self._out = plan, identity, out
        self._journal: SweepJournal | None = None
        if out is None:
            return
        require_parquet()
        self._journal = SweepJournal(journal_of(out), fresh=fresh)
        try:
            if not fresh:
                self._resume(out, self._journal)
        except BaseException:
            self._journal.close()
            if self._journal.identity is None:
                self._journal.path.unlink(missing_ok=True)
            raise
        if self._journal.identity is None:
            self._journal.begin(identity)

    @property
    def pending(self) -> list[int]:
        """The runs that are not finished."""
        return [run for run in range(len(self._plan)) if run not in self.rows]

    def add(self, row: SweepRow, found: dict[str, Measure]) -> None:
        """Store a row; after that, it survives even if the process is killed."""
        self.rows[row.run] = row
        self._described = {**found, **self._described}
        if self._journal is not None:
            self._journal.add(row, found)

    def close(self) -> Sweep:
        """Write all finished rows to the file, and return the sweep."""
        sweep = Sweep.collect(
            self._plan, self._identity, self.rows.values(), self._described
        )
        if self._out is not None and self._journal is not None:
            try:
                sweep.save(self._out)
            except BaseException:
                self._journal.close()
                raise
            self._journal.remove()
        return sweep

    def _resume(self, out: Path, journal: SweepJournal) -> None:
        if journal.identity is not None:
            self._compare(journal.path, journal.identity)
        earlier: list[SweepRow] = []
        if out.exists():
            sweep = Sweep.load(out)
            self._compare(out, sweep.meta["identity"])
            earlier = sweep.rows()
            self._described = {
                name: Measure(0.0, **entry)
                for name, entry in sweep.meta["metrics"].items()
            }
        self._described = {**self._described, **journal.described}
        self.rows = {
            row.run: row
            for row in [*earlier, *journal.rows]
            if row.status not in (CRASHED, TIMED_OUT)
        }

    def _compare(self, path: Path, identity: dict[str, Any]) -> None:
        for name, own in self._identity.items():
            other = identity.get(name)
            if json.dumps(own) != json.dumps(other):
                raise SweepError(
                    f"{path}: contains another sweep: {_difference(name, other, own)}; "
                    "give another --out, or --fresh to overwrite it"
                )


def _difference(name: str, other: Any, own: Any) -> str:
    """Return the difference between two parts of sweeps' identities, as text."""
    if isinstance(own, dict) and isinstance(other, dict):
        for key in sorted({*own, *other}):
            if json.dumps(own.get(key)) != json.dumps(other.get(key)):
                return _difference(f"{name}.{key}", other.get(key), own.get(key))
    if name == "model":
        return "the model of its robot is different"
    return f"its {name} is {shown(other)}, not {shown(own)}"
