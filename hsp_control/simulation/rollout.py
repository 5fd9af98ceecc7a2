"""The rollout of a run: named columns with their descriptions, and its file."""

import errno
import json
import zipfile
from collections.abc import Callable, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any, Self

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LogError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.robot import Robot, RobotState
from hsp_control.simulation.journal import is_journal, read_journal
from hsp_control.simulation.log_file import (
    MAX_SIZE,
    read_arrays,
    shortened,
    write_arrays,
)
from hsp_control.simulation.log_meta import (
    drawable_rows,
    find_fault,
    renamed_entries,
)
from hsp_control.simulation.salvage import read_complete_entries

FORMAT = "hsp_control rollout 1"
_DISK_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_MAX_NAME = 1000  # characters; a name in a zip archive has at most 65535 bytes
_REQUIRED = ("t", "q", "v", "tau")


class Rollout:
    """One run: columns of equal length, row i at time t[i], and their descriptions.

    Attributes:
        columns: Arrays by name; ``t``, ``q``, ``v``, ``tau`` always exist.
        meta: JSON data: ``format``, ``status``, ``columns`` (name to unit and
            meaning), ``robot``, ``tasks``, ``versions``, ``config`` and more.
    """

    def __init__(self, columns: Mapping[str, Array], meta: dict[str, Any]) -> None:
        """Set the columns and the meta data; arrays are not copied."""
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
        return f"Rollout({len(self)} rows, {span}, {self.status})"

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
        """The resolved configuration of the run; None if it was made in Python."""
        return self.meta.get("config")

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
        state = RobotState(robot)
        rows = zip(self.t.tolist(), self.q, self.v, strict=True)
        # Each update overwrites the state's arrays, so np.array must copy.
        return np.array([np.array(function(state.update(*row))) for row in rows])

    def save(self, path: str | Path) -> Path:
        """Write one ``.npz`` without pickles, which NumPy can read by itself.

        It is written to a temporary file and then renamed, so that ``path`` is never an
        incomplete file. If the disk is full, the part that fits is kept beside it for
        `salvage`, provided that it has the motion; the message names that file.

        Returns:
            The path.

        Raises:
            LogError: If the file cannot be written.
        """
        path = Path(path)
        part = path.with_name(f".{path.name}.part")
        if any(len(name) > _MAX_NAME for name in self.columns):
            raise LogError(
                f"{path}: cannot write the log: a column's name has more than "
                f"{_MAX_NAME} characters"
            )
        meta = np.array(json.dumps(self.meta, ensure_ascii=False))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("wb") as file:
                write_arrays(file, {"meta": meta, **self.columns})
            part.replace(path)
        except OSError as error:
            kept = _keep_part(part, path) if error.errno in _DISK_FULL else ""
            _remove(part)
            reason = error.strerror or str(error)
            raise LogError(f"{path}: cannot write the log: {reason}{kept}") from error
        except BaseException:  # also a second Ctrl-C: leave no temporary file
            _remove(part)
            raise
        return path

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a log: an ``.npz``, or a `journal` with all its complete rows.

        The file may be untrusted: nothing in it is ever executed.

        Raises:
            LogError: If the file is missing, truncated, too large, not a log of this
                package, or inconsistent.
        """
        path = Path(path)
        try:
            if is_journal(path):
                columns, meta = read_journal(path)
                complete_columns(columns, [])  # one absurd turn would spoil all later
                columns, meta = without_absurd_rows(columns, meta)
                complete_columns(columns, meta["robot"]["continuous"])
                columns["meta"] = np.array(json.dumps(meta, ensure_ascii=False))
            else:
                columns = read_arrays(path)
        except LogError:
            raise
        except FileNotFoundError:
            near = [file.name for file in path.parent.glob("*.npz")]
            raise LogError(
                f"{path}: no such file{did_you_mean(path.name, near)}"
            ) from None
        except (OSError, ValueError, EOFError, KeyError, zipfile.BadZipFile) as error:
            reason = str(error).splitlines()[0] if str(error) else type(error).__name__
            raise LogError(
                f"{path}: not a complete .npz log (truncated, or another file): "
                f"{reason}"
                f"{_salvageable(path)}"
            ) from error
        except Exception as error:  # zlib.error, struct.error, NotImplementedError...
            raise LogError(
                f"{path}: not a complete .npz log: {type(error).__name__}: {error}"
            ) from error
        return cls(*_checked(path, columns))

    @classmethod
    def salvage(cls, path: str | Path) -> Self:
        """Read the complete entries of a truncated log; ``meta["lost"]`` has the rest.

        Raises:
            LogError: If the meta data or the motion (t, q, v, tau) is incomplete, or
                the complete entries are not a log.
        """
        path = Path(path)
        try:
            columns, cut_entry = read_complete_entries(path)
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"{path}: cannot be read: {reason}") from error
        described = _described(columns)
        lost = [name for name in described if name not in columns]
        missing = [name for name in ("meta", *_REQUIRED) if name not in columns]
        if missing:
            where = f": it is truncated in {cut_entry!r}" if cut_entry else ""
            raise LogError(
                f"{path}: nothing to salvage{where}; {missing[0]!r} is incomplete"
            )
        return cls(*_checked(path, columns, lost))


def _keep_part(part: Path, path: Path) -> str:
    """Keep an incomplete log if it has the motion; return a note with its name."""
    kept = path.with_suffix(".cut.npz")
    try:
        columns, _ = read_complete_entries(part)
        if {"meta", *_REQUIRED} <= set(columns):
            part.replace(kept)
            return f"; the part that fits is in {kept}: hsp salvage {kept}"
    except OSError:
        pass
    return ""


def _remove(part: Path) -> None:
    with suppress(OSError):  # its folder may not exist
        part.unlink(missing_ok=True)


def _salvageable(path: Path) -> str:
    """Return a hint for a truncated log that can be salvaged, "" for any other."""
    try:
        columns, _ = read_complete_entries(path)
    except OSError:
        return ""
    complete = {"meta", *_REQUIRED} <= set(columns)
    return f"; its motion is complete: hsp salvage {path}" if complete else ""


def _described(columns: dict[str, Array]) -> list[str]:
    """Return the names of the columns in the entry 'meta', [] if it is not readable."""
    try:
        described = json.loads(str(columns["meta"]))["columns"]
    except (KeyError, TypeError, ValueError, RecursionError):
        return []
    return list(described) if isinstance(described, dict) else []


def complete_columns(columns: Mapping[str, Array], continuous: Sequence[int]) -> None:
    """Complete columns that were written row by row, in place.

    Positions of continuous joints pass ±π without a jump. For a task that was added
    during the run, the earlier rows get its first reference and position, because what
    is drawn must be finite. Its errors stay NaN there.

    Args:
        columns: The columns by name, N rows each.
        continuous: The dofs of continuous joints.
    """
    positions, dofs = columns["joint_positions"], list(continuous)
    positions[:, dofs] = np.unwrap(positions[:, dofs], axis=0)
    for name, column in columns.items():
        if name.startswith("task.") and name.endswith((".reference", ".actual")):
            finite = np.flatnonzero(np.isfinite(column).all(axis=1))
            if finite.size:
                column[: finite[0]] = column[finite[0]]


def without_absurd_rows(
    columns: dict[str, Array], meta: dict[str, Any]
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns without rows that cannot be drawn; the message counts them.

    Args:
        columns: The columns by name, N rows each.
        meta: The meta data.
    """
    kept = drawable_rows(columns)
    if kept.all():
        return columns, meta
    count, first = int((kept == 0).sum()), columns["t"][int(kept.argmin())]
    told = f"{count} of {len(kept)} rows are left out, from t = {first:g} s on: their "
    told += "numbers are too large, or not finite"
    meta = {**meta, "message": "; ".join(filter(None, (meta.get("message"), told)))}
    return {name: column[kept] for name, column in columns.items()}, meta


def _checked(
    path: Path, columns: dict[str, Array], lost: Sequence[str] = ()
) -> tuple[dict[str, Array], dict[str, Any]]:
    """Return the columns and the meta data of an untrusted log.

    Every log passes here, however it was read.

    Raises:
        LogError: If it is not a log of this package, or inconsistent.
    """
    if "meta" not in columns or columns["meta"].dtype.kind != "U":
        raise LogError(
            f"{path}: not a log of hsp_control: it has no text entry 'meta' "
            f"(it has {listing(columns)})"
        )
    try:
        meta = json.loads(str(columns.pop("meta")))
    except (json.JSONDecodeError, RecursionError) as error:
        raise LogError(f"{path}: its entry 'meta' is not JSON: {error}") from error
    if not isinstance(meta, dict) or meta.get("format") != FORMAT:
        found = meta.get("format") if isinstance(meta, dict) else meta
        raise LogError(
            f"{path}: its format is {shortened(found)}; this version reads {FORMAT!r}"
        )
    meta = renamed_entries(meta)
    if lost:
        kept = {n: d for n, d in meta["columns"].items() if n not in lost}
        meta = {**meta, "columns": kept, "lost": list(lost)}
        if isinstance(obstacles := meta.get("obstacles"), dict):
            seen = {k: v for k, v in obstacles.items() if f"obstacle.{k}" not in lost}
            meta["obstacles"] = seen
    described = meta.get("columns")
    wanted = [*_REQUIRED, *(described if isinstance(described, dict) else ())]
    missing = [name for name in wanted if name not in columns]
    if missing:
        raise LogError(f"{path}: the log lacks the column {shortened(missing[0])}")
    rows = {name: np.shape(column)[:1] for name, column in columns.items()}
    if any(length != rows["t"] for length in rows.values()):
        raise LogError(f"{path}: the log's columns differ in length")
    if 8 * sum(column.size for column in columns.values()) > MAX_SIZE:
        raise LogError(f"{path}: larger than {MAX_SIZE / 1e9:g} GB in memory")
    if reason := find_fault(meta, columns):
        raise LogError(f"{path}: {reason}")
    return {name: np.asarray(c, dtype=float) for name, c in columns.items()}, meta
