"""The rollout of a run: named columns with their descriptions, and its file."""

import json
import logging
import math
import tokenize
import zipfile
import zlib
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError
from hsp_control.common.regular_file import why_endless
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.common.unicode_text import json_text
from hsp_control.declaration.language import spoken
from hsp_control.robot import Robot, RobotState
from hsp_control.robot.recorded import warn_of_another_robot
from hsp_control.simulation.journal import KILLED, JournalReader, is_journal
from hsp_control.simulation.log_meta import (
    WrongMetaError,
    check_complete,
    check_kinds,
    check_robot,
)
from hsp_control.simulation.log_shapes import WrongColumnError, check_columns
from hsp_control.simulation.run_summary import damped_rows, summary_text

LARGEST = 20_000_000_000
"""Most bytes of a log that is read."""
_log = logging.getLogger(__name__)

FORMAT = "hsp_control rollout 1"
_REQUIRED = ("t", "q", "v", "tau")
_UNREADABLE = (
    OSError, ValueError, EOFError, KeyError, NotImplementedError,
    zipfile.BadZipFile, zlib.error, RuntimeError, MemoryError, TypeError,
)  # fmt: skip
"""The errors of a file that is truncated, damaged, something else or encrypted."""

_RUNNING = 1.0
"""``live.phase`` before a safe stop: `Phase` is above this layer."""


class Rollout:
    """One run: columns of equal length, row i at time t[i], and their descriptions.

    Attributes:
        columns: Arrays by name; ``t``, ``q``, ``v``, ``tau`` always exist.
        meta: JSON data: ``format``, ``status``, ``columns`` (name to unit and
            meaning), ``robot``, ``tasks``, ``versions``, ``config`` and more.
    """

    def __init__(self, columns: Mapping[str, Array], meta: dict[str, Any]) -> None:
        self.columns = dict(columns)
        self.meta = meta

    def __getitem__(self, name: str) -> Array:
        try:
            return self.columns[name]
        except KeyError:
            raise LogError(
                f"the log has no column {name!r}{did_you_mean(name, self.columns)} "
                f"(it has {listing(self.columns, 40)})"
            ) from None

    def __contains__(self, name: str) -> bool:
        return name in self.columns

    def __len__(self) -> int:
        return len(self.t)

    def __repr__(self) -> str:
        span = f"{self.t[0]:g} to {self.t[-1]:g} s" if len(self) else "empty"
        about = self.meta.get("robot", {}).get("name", "?")
        tasks = ", ".join(self.meta.get("tasks", {}))
        how = self.status
        if damped := damped_rows(self):
            how += f", damped in {damped} rows"
        return f"Rollout({about}: {tasks}; {len(self)} rows, {span}, {how})"

    def __str__(self) -> str:
        """Return the table that ``hsp run`` prints."""
        return summary_text(self)

    @property
    def t(self) -> Array:
        """Time [s], shape (N,)."""
        return self.columns["t"]

    @property
    def q(self) -> Array:
        """Configuration, shape (N, nq)."""
        return self.columns["q"]

    @property
    def v(self) -> Array:
        """Velocity, shape (N, nv)."""
        return self.columns["v"]

    @property
    def tau(self) -> Array:
        """Effort, shape (N, nv)."""
        return self.columns["tau"]

    @property
    def status(self) -> str:
        """``completed``, ``interrupted``, ``diverged``; ``stopped`` by a safe stop."""
        return str(self.meta["status"])

    @property
    def config(self) -> dict[str, Any] | None:
        """The resolved configuration of the run; None if a part of it is Python.

        That of a live loop without a duration has the one until its stop, or until it
        was killed.
        """
        config: dict[str, Any] | None = self.meta.get("config")
        settings = None if config is None else config.get("simulation")
        if config is None or not isinstance(settings, dict):
            return config
        if settings.get("duration", 0.0) is not None:
            return config
        period, t = settings["log_period"], self.before_stop().t
        rows = round(float(t[-1] - t[0]) / period) if len(t) else 0
        return config | {"simulation": settings | {"duration": max(rows, 1) * period}}

    def before_stop(self) -> Self:
        """Return the rows of a live run before its safe stop, which follows no task.

        The run itself if it has no safe stop, or nothing else.
        """
        stopping = self.columns.get("live.phase", np.zeros(len(self))) > _RUNNING
        if stopping.all() or not stopping.any():
            return self
        columns = {name: each[~stopping] for name, each in self.columns.items()}
        return type(self)(columns, self.meta)

    def measure(self, robot: Robot, function: Callable[[RobotState], Any]) -> Array:
        """Return a function of the state at every row, shape (N, ...).

        For quantities that are not logged: ``run.measure(robot, cost.value)``, or
        ``run.measure(robot, lambda state: state.position("panda_link4"))``.

        Args:
            robot: The run's robot.
            function: Returns a number or an array for a state.

        Raises:
            ShapeError: If the run is of another robot.
        """
        if self.q.shape[1:] == (robot.nq,):
            warn_of_another_robot(robot, self.meta)
        state = RobotState(robot)
        rows = zip(self.t.tolist(), self.q, self.v, strict=True)
        # Each update overwrites the state's arrays, so np.array must copy.
        return np.array([np.array(function(state.update(*row))) for row in rows])

    def save(self, path: str | Path) -> Path:
        """Write one ``.npz`` without pickles, which NumPy can read by itself.

        It is written to a temporary file and then renamed, so that ``path`` is never an
        incomplete file.

        Returns:
            The path.

        Raises:
            LogError: If the file cannot be written.
        """
        path = Path(path)
        part = path.with_name(f".{path.name}.part")
        arrays: dict[str, Any] = {
            "meta": np.array(json_text(self.meta)), **self.columns
        }  # fmt: skip
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("wb") as file:
                np.savez_compressed(file, allow_pickle=False, **arrays)
            part.replace(path)
        except (OSError, ValueError) as error:  # a name may contain invalid characters
            _remove(part)
            reason = getattr(error, "strerror", None) or str(error)
            raise LogError(f"{path}: cannot write the log: {reason}") from error
        except BaseException:  # also a second Ctrl-C: leave no temporary file
            _remove(part)
            raise
        return path

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a log: an ``.npz``, or a `journal` with all its complete rows.

        No pickle is opened, so that nothing in the file is ever executed.

        Raises:
            LogError: If the file is missing, truncated, or not a log of this version.
        """
        path = Path(path)
        if path.suffix in (".yaml", ".yml"):
            made = spoken(f"hsp run {path} writes", "load_experiment(...).run() makes")
            raise LogError(f"{path}: a configuration, not a log; {made} one")
        kind, read = ".npz log", _read_npz
        try:
            if why := why_endless(path):
                raise LogError(f"{path}: {why}; no log")
            if is_journal(path):
                kind, read = "journal", _read_journal
            columns, meta = read(path)
            if meta.get("format") == FORMAT:
                check_kinds(meta)
                check_columns(columns, meta)
        except (WrongColumnError, WrongMetaError) as error:
            raise LogError(f"{path}: {error}") from None
        except LogError:
            raise
        except FileNotFoundError:
            folders = path.parent, path.parent / "out"
            near = [str(f) for folder in folders for f in folder.glob("*.npz")]
            raise LogError(
                f"{path}: no such file{did_you_mean(str(path), near)}"
            ) from None
        except _UNREADABLE as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise LogError(
                f"{path}: not a complete {kind} (truncated, or another file): {reason}"
            ) from error
        if meta.get("format") != FORMAT:
            raise LogError(
                f"{path}: its format is {meta.get('format')!r}; this version reads "
                f"{FORMAT!r}"
            )
        for name in (*_REQUIRED, *meta.get("columns", ())):
            if name not in columns:
                raise LogError(f"{path}: the log lacks the column {name!r}")
        try:
            check_complete(meta)
        except WrongMetaError as error:
            raise LogError(f"{path}: {error}") from None
        return cls(columns, meta)


def _read_journal(path: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns and the meta data of a journal, up to its last whole row."""
    reader = JournalReader(path)
    reader.read()
    if not reader.meta:
        why = "is a sweep's" if reader.notes else "ends before its first heading"
        why = "has no whole heading: it is damaged" if reader.damaged else why
        raise LogError(f"{path}: the journal {why}")
    columns, meta = reader.rows(0), reader.meta
    check_kinds(meta)
    check_robot(meta)
    check_columns(columns, meta)
    complete_columns(columns, meta["robot"]["continuous"])
    if not reader.ended:
        meta = {**meta, "status": "interrupted", "message": KILLED}
    if damaged := reader.damaged + reader.ends_damaged():
        which = "row of the journal is" if damaged == 1 else "rows of the journal are"
        lost = f"{damaged} damaged {which} left out"
        _log.warning("%s: %s", path, lost)
        meta = {**meta, "damaged": damaged}
        meta["message"] = "; ".join(filter(None, (meta.get("message"), lost)))
    return columns, meta


def _read_npz(path: Path) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns and the meta data of an ``.npz``."""
    with path.open("rb") as file:
        if not zipfile.is_zipfile(file):
            raise zipfile.BadZipFile("no archive")
        file.seek(0)
        with zipfile.ZipFile(file) as archive:
            _check_sizes(archive)
        file.seek(0)
        with np.load(file, allow_pickle=False) as archive:
            columns = {name: archive[name] for name in archive.files}
    try:
        meta = json.loads(columns.pop("meta").item())
    except (KeyError, TypeError, ValueError, RecursionError):
        meta = None
    if not isinstance(meta, dict):
        raise LogError(
            f"{path}: not a log of hsp_control: it has no text entry 'meta' with a "
            f"JSON object (it has {listing(columns)})"
        )
    for name, column in columns.items():
        if column.dtype.kind not in "fiub":
            raise LogError(
                f"{path}: the column {name!r:.80} is of {column.dtype}; needs numbers"
            )
    return {name: np.asarray(c, dtype=float) for name, c in columns.items()}, meta


def _check_sizes(archive: zipfile.ZipFile) -> None:
    """Check that arrays have the sizes that they declare, before memory is taken."""
    total = 0
    for entry in archive.infolist():
        total += entry.file_size
        with archive.open(entry) as file:
            version = np.lib.format.read_magic(file)
            read = {
                (1, 0): np.lib.format.read_array_header_1_0,
                (2, 0): np.lib.format.read_array_header_2_0,
            }[version]
            try:
                shape, _, kind = read(file)
            except (SyntaxError, tokenize.TokenError) as error:  # of its header's text
                raise ValueError(f"{entry.filename}: {error}") from None
        if math.prod(shape) * kind.itemsize > entry.file_size:
            size = math.prod(shape) * kind.itemsize
            raise ValueError(
                f"{entry.filename} declares {size:.3g} bytes and has {entry.file_size}"
            )
    if total > LARGEST:
        raise ValueError(f"it has {total:.3g} bytes; at most {LARGEST:g} are read")


def _remove(part: Path) -> None:
    with suppress(OSError, ValueError):  # its folder may not exist
        part.unlink(missing_ok=True)


def complete_columns(columns: Mapping[str, Array], continuous: Sequence[int]) -> None:
    """Complete columns that were written row by row, in place.

    Continuous joints pass ±π without a jump. A task that was added during the run gets
    its first reference and position before, because drawn values must be finite.
    """
    positions, dofs = columns["joint_positions"], list(continuous)
    positions[:, dofs] = np.unwrap(positions[:, dofs], axis=0)
    for name, column in columns.items():
        if name.startswith("task.") and name.endswith((".reference", ".actual")):
            finite = np.flatnonzero(np.isfinite(column).all(axis=1))
            if finite.size:
                column[: finite[0]] = column[finite[0]]
