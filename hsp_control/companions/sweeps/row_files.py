"""The rows of a sweep, in memory and in a folder of Parquet files.

Rows are written some seconds after they arrive, always to a new file; a file has
the whole description of the sweep. When the sweep ends, few large files replace the
many. After an interruption the folder can be read, and continued.
"""

import fcntl
import json
import logging
import os
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from time import monotonic
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from hsp_control.common.errors import SweepError
from hsp_control.common.regular_file import check_ends
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.sweeps.one_run import CRASHED, TIMED_OUT, Row
from hsp_control.companions.sweeps.plan import SweepPlan
from hsp_control.declaration.language import shown

FORMAT = "hsp_control sweep 2"
SECONDS = 5.0
"""Maximum time for which a row is only in memory [s]."""
MOST = 100_000
"""Number of rows in a file of a completed sweep."""

_log = logging.getLogger(__name__)
_KEY = b"hsp_control"  # of the metadata
_NAME = "rows-{:06d}.parquet"


class RowFiles:
    """The rows of a sweep, and its folder, which no other process writes meanwhile.

    Attributes:
        done: The runs that have a row that need not be computed again.
        failures: The number of them that did not complete.
        table: All rows that are in files.
    """

    def __init__(
        self,
        plan: SweepPlan,
        identity: dict[str, Any],
        folder: Path | None,
        *,
        fresh: bool,
    ) -> None:
        """Read the rows that the folder contains already.

        Raises:
            SweepError: If they belong to another sweep, or the folder cannot be
            written.
        """
        self._plan, self._folder, self._lock = plan, folder, -1
        self._meta: dict[str, Any] = {
            "format": FORMAT,
            "name": plan.base.name,
            "runs": len(plan),
            "identity": identity,
        }
        self._columns, self._meta["parameters"] = _parameters(plan)
        self._new: list[Row] = []
        self.table = self._as_table([])
        if folder is not None:
            self._open(folder, fresh=fresh)
        rows = self.table.select(["run", "status"]).to_pylist()
        lost = {row["run"] for row in rows if row["status"] in (CRASHED, TIMED_OUT)}
        self.done = {row["run"] for row in rows} - lost
        self.failures = sum(
            row["status"] != "completed" for row in rows if row["run"] in self.done
        )
        if lost:
            keep = np.isin(self.table["run"].to_numpy(), [*lost], invert=True)
            self.table = self.table.filter(pa.array(keep))
        self._written = monotonic()

    def _open(self, folder: Path, *, fresh: bool) -> None:
        self._number = 0
        try:
            if folder.exists() and not folder.is_dir():
                raise SweepError(
                    f"{folder}: a file, and sweeps are folders of files now; "
                    "give another --out"
                )
            self._take(folder)
            # Left by a process that was killed while it wrote; no other writes here
            # now.
            self._remove([*folder.glob(".*.part")])
            files = _files(folder)
            if files:
                self._number = int(files[-1].stem.rpartition("-")[2])
                found, meta = read_rows(folder)
                if fresh:
                    self._remove(files)
                else:
                    self._compare(folder, meta["identity"])
                    self.table = _joined([self.table, found])
        except OSError as error:
            raise SweepError(
                f"{folder}: cannot be written: {error.strerror}"
            ) from error
        except BaseException:
            self._unlock()
            raise

    def _take(self, folder: Path) -> None:
        """Make a folder, unless it exists, and lock it."""
        folder.mkdir(parents=True, exist_ok=True)
        self._lock = os.open(folder / ".lock", os.O_RDWR | os.O_CREAT, 0o644)
        try:
            fcntl.flock(self._lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            os.close(self._lock)
            self._lock = -1
            raise SweepError(f"{folder}: another sweep writes it already") from None

    def _restore(self, folder: Path) -> None:
        """Write all rows again if the folder was deleted meanwhile."""
        if folder.is_dir():
            return
        os.close(self._lock)
        self._lock = -1
        try:
            self._take(folder)
        except OSError as error:
            raise SweepError(
                f"{folder}: deleted, and cannot be written again: {error.strerror}"
            ) from error
        _log.warning("%s was deleted meanwhile; it is written again", folder)
        if len(self.table):
            self._put(self.table)

    def _compare(self, path: Path, identity: dict[str, Any]) -> None:
        for name, own in self._meta["identity"].items():
            other = identity.get(name)
            if json.dumps(own) != json.dumps(other):
                raise SweepError(
                    f"{path}: contains another sweep: {_difference(name, other, own)}; "
                    "give another --out, or --fresh to overwrite it"
                )

    def add(self, row: Row) -> None:
        """Add a row; see `write_if_due`."""
        self._new.append(row)
        self.done.add(row.run)
        self.failures += row.status != "completed"
        self.write_if_due()

    def write_if_due(self) -> None:
        """Write the rows that are only in memory if they have been for `SECONDS`."""
        if monotonic() - self._written > SECONDS:
            self.write()

    def write(self) -> None:
        """Write the rows that are only in memory."""
        if self._folder is not None:
            self._restore(self._folder)
        if self._new:
            # In the order of runs, whatever the order in which they ended.
            table = self._as_table(sorted(self._new, key=lambda row: row.run))
            if self._folder is not None:
                self._put(table)
            self.table = _joined([self.table, table])
            self._new.clear()
        self._written = monotonic()

    def close(self) -> None:
        """Write all rows as few files, and release the folder for other processes."""
        try:
            self.write()
            if self._folder is None:
                return
            earlier = _files(self._folder)
            if len(earlier) > -(-len(self.table) // MOST):
                for begin in range(0, len(self.table), MOST):
                    self._put(self.table.slice(begin, MOST))
                self._remove(earlier)
        finally:
            self._unlock()

    @property
    def meta(self) -> dict[str, Any]:
        """The metadata of the rows."""
        return _meta(self.table)

    def _put(self, table: pa.Table) -> None:
        """Write a file atomically, under another name first."""
        assert self._folder is not None
        self._number += 1
        path = self._folder / _NAME.format(self._number)
        part = self._folder / f".{path.name}.part"
        try:
            with part.open("wb") as file:
                pq.write_table(table, file, compression="zstd")
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        except OSError as error:
            reason = error.strerror or str(error)
            raise SweepError(f"{path}: cannot write the sweep: {reason}") from error
        finally:  # Ctrl-C may interrupt the writing: `close` writes the rows again
            part.unlink(missing_ok=True)

    def _remove(self, files: Sequence[Path]) -> None:
        for file in files:
            file.unlink(missing_ok=True)

    def _unlock(self) -> None:
        if self._folder is not None and self._lock >= 0:
            with suppress(OSError):
                (self._folder / ".lock").unlink()
            with suppress(OSError):  # if it has no rows
                self._folder.rmdir()
            os.close(self._lock)
            self._lock = -1

    def _as_table(self, rows: Sequence[Row]) -> pa.Table:
        """Return rows as a table that describes itself, its metrics by name."""
        runs = np.array([row.run for row in rows], dtype=np.int64)
        columns: dict[str, Any] = {
            "run": runs,
            "status": pa.array([row.status for row in rows], pa.string()),
            "message": pa.array([row.message for row in rows], pa.string()),
            "wall_time": np.array([row.wall_time for row in rows], dtype=float),
        }
        for name, column in self._columns.items():
            columns[name] = column.take(pa.array(runs))
        described = {
            name: {"unit": measure.unit, "meaning": measure.meaning}
            for row in rows
            for name, measure in row.metrics.items()
        }
        for name in sorted(described):
            columns[name] = pa.array(
                [
                    row.metrics[name].value if name in row.metrics else None
                    for row in rows
                ],
                pa.float64(),
                from_pandas=True,  # NaN becomes null, too
            )
        meta = {**self._meta, "metrics": dict(sorted(described.items()))}
        return pa.table(columns).replace_schema_metadata(
            {_KEY: json.dumps(meta).encode()}
        )


def read_rows(path: Path) -> tuple[pa.Table, dict[str, Any]]:
    """Return the rows of a folder, or of one of its files, and their metadata.

    Raises:
        SweepError: If there are none, or they are not those of a sweep.
    """
    try:
        check_ends(path)
        files = _files(path) if path.is_dir() else [path]
        tables = [pq.read_table(file, partitioning=None) for file in files]
    except FileNotFoundError:
        near = [file.name for file in path.parent.glob("*.parquet")]
        raise SweepError(
            f"{path}: no such file{did_you_mean(path.name, near)}"
        ) from None
    except (OSError, pa.ArrowException) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise SweepError(f"{path}: not a complete Parquet file: {reason}") from error
    if not tables:
        raise SweepError(f"{path}: a folder without rows of a sweep")
    for table in tables:
        if _KEY not in (table.schema.metadata or {}):
            raise SweepError(f"{path}: a Parquet file, but not a sweep")
        if (found := _meta(table).get("format")) != FORMAT:
            raise SweepError(
                f"{path}: its format is {found!r}; this version reads {FORMAT!r}"
            )
    table = _joined(tables)
    return table, _meta(table)


def _files(folder: Path) -> list[Path]:
    return sorted(folder.glob("rows-*.parquet"))


def _meta(table: pa.Table) -> dict[str, Any]:
    return dict(json.loads(table.schema.metadata[_KEY]))


def _joined(tables: Sequence[pa.Table]) -> pa.Table:
    """Return tables as one, in the order of runs; the last row of each run is kept."""
    metas = [_meta(table) for table in tables]
    described = {k: v for meta in metas for k, v in meta["metrics"].items()}
    table = pa.concat_tables(tables, promote_options="default")
    runs = table["run"].to_numpy()
    _, last = np.unique(runs[::-1], return_index=True)
    first = [name for name in table.column_names if name not in described]
    # By name, whatever the order in which rows arrived.
    table = table.take(pa.array(len(runs) - 1 - last)).select(
        [*first, *sorted(described)]
    )
    meta = {**metas[0], "metrics": dict(sorted(described.items()))}
    return table.combine_chunks().replace_schema_metadata(
        {_KEY: json.dumps(meta).encode()}
    )


def _parameters(plan: SweepPlan) -> tuple[dict[str, pa.Array], dict[str, Any]]:
    """Return each parameter's values in all runs, and how to read them.

    The types are those of all values of the plan, so that all files have the same.
    """
    columns, described = {}, {}
    for k, factor in enumerate(plan.factors):
        values = [point[k] for point in plan.points]
        kind = _kind(values)
        texts = values if kind is not None else [json.dumps(value) for value in values]
        columns[factor.name] = pa.array(texts, kind or pa.string())
        described[factor.name] = {"keys": list(factor.keys), "json": kind is None}
    return columns, described


def _kind(values: Sequence[Any]) -> pa.DataType | None:
    """Return the type of a column of values; None if they have different types."""
    kinds = {type(value) for value in values}
    if kinds == {str}:
        return pa.string()
    if kinds == {bool}:
        return pa.bool_()
    if kinds == {int} and all(abs(value) < 2**63 for value in values):
        return pa.int64()
    if kinds and kinds <= {int, float} and all(abs(value) < 2**53 for value in values):
        return pa.float64()
    return None


def _difference(name: str, other: Any, own: Any) -> str:
    """Return the difference between two parts of sweeps' identities, as text."""
    if isinstance(own, dict) and isinstance(other, dict):
        for key in sorted({*own, *other}):
            if json.dumps(own.get(key)) != json.dumps(other.get(key)):
                return _difference(f"{name}.{key}", other.get(key), own.get(key))
    if name == "model":
        return "the model of its robot is different"
    return f"its {name} is {shown(other)}, not {shown(own)}"
