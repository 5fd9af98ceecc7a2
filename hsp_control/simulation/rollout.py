"""A rollout: what happened, as named columns that describe themselves, and its file."""

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
from hsp_control.simulation.log_meta import complaint
from hsp_control.simulation.salvage import read_whole_entries

FORMAT = "hsp_control rollout 1"
_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)
_LONGEST = 1000  # characters of a name: an archive has room for 65535 bytes
_REQUIRED = ("t", "q", "v", "tau")


class Rollout:
    """One run: columns of equal length, row i at time t[i], and what they mean.

    Attributes:
        columns: Arrays by name; ``t``, ``q``, ``v``, ``tau`` always exist.
        meta: JSON data: ``format``, ``status``, ``columns`` (name to unit and
            meaning), ``robot``, ``tasks``, ``versions``, ``config`` and more.
    """

    def __init__(self, columns: Mapping[str, Array], meta: dict[str, Any]) -> None:
        """Keep columns and their description."""
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
        """``completed``, ``interrupted``, ``diverged``; ``stopped``: a safe stop."""
        return str(self.meta["status"])

    @property
    def config(self) -> dict[str, Any] | None:
        """The resolved configuration that the run came from, if it came from one."""
        return self.meta.get("config")

    def measure(self, robot: Robot, function: Callable[[RobotState], Any]) -> Array:
        """Return a function of the state at every row, shape (N, ...).

        For what the run did not log: ``run.measure(robot, cost.value)``, or
        ``run.measure(robot, lambda state: state.position("panda_link4"))``.

        Args:
            robot: The run's robot.
            function: What to compute of a state: a number or an array.

        Raises:
            ShapeError: If the run is of another robot.
        """
        state = RobotState(robot)
        rows = zip(self.t.tolist(), self.q, self.v, strict=True)
        # The state's arrays move on with it: np.array copies.
        return np.array([np.array(function(state.update(*row))) for row in rows])

    def save(self, path: str | Path) -> Path:
        """Write one ``.npz`` that NumPy alone reads, without pickles.

        Written beside its place and moved there, so that no half file bears its name.
        Where the disk fills, as much as fits stays beside it for `salvage`, if that has
        the motion; the message names it.

        Raises:
            LogError: If the file cannot be written.
        """
        path = Path(path)
        part = path.with_name(f".{path.name}.part")
        if any(len(name) > _LONGEST for name in self.columns):
            raise LogError(
                f"{path}: cannot write the log: a column's name has more than "
                f"{_LONGEST} characters"
            )
        meta = np.array(json.dumps(self.meta, ensure_ascii=False))
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with part.open("wb") as file:
                write_arrays(file, {"meta": meta, **self.columns})
            part.replace(path)
        except OSError as error:
            kept = _keep_part(part, path) if error.errno in _FULL else ""
            _remove(part)
            reason = error.strerror or str(error)
            raise LogError(f"{path}: cannot write the log: {reason}{kept}") from error
        except BaseException:  # a second Ctrl-C: then without it
            _remove(part)
            raise
        return path

    @classmethod
    def load(cls, path: str | Path) -> Self:
        """Read a log: an ``.npz``, or a `journal` with all its whole rows.

        It may be a stranger's: nothing in it is ever executed.

        Raises:
            LogError: If the file is missing, truncated, too large, not a log of this
                package, or one that contradicts itself.
        """
        path = Path(path)
        try:
            if is_journal(path):
                columns, meta = read_journal(path)
                settle(columns, meta["robot"]["continuous"])
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
                f"{path}: not a whole .npz log (cut short, or another file): {reason}"
                f"{_salvageable(path)}"
            ) from error
        except Exception as error:  # zlib.error, struct.error, NotImplementedError...
            raise LogError(
                f"{path}: not a whole .npz log: {type(error).__name__}: {error}"
            ) from error
        return cls(*_checked(path, columns))

    @classmethod
    def salvage(cls, path: str | Path) -> Self:
        """Read what is whole of a log that was cut; ``meta["lost"]`` names the rest.

        Raises:
            LogError: If not even the motion (t, q, v, tau) is whole, or what is whole
                is no log.
        """
        path = Path(path)
        try:
            columns, cut = read_whole_entries(path)
        except OSError as error:
            reason = error.strerror or str(error)
            raise LogError(f"{path}: cannot be read: {reason}") from error
        described = _described(columns)
        lost = [name for name in described if name not in columns]
        missing = [name for name in ("meta", *_REQUIRED) if name not in columns]
        if missing:
            where = f": it is cut in {cut!r}" if cut else ""
            raise LogError(
                f"{path}: nothing to salvage{where}; {missing[0]!r} is not whole"
            )
        return cls(*_checked(path, columns, lost))


def _keep_part(part: Path, path: Path) -> str:
    """Keep a half-written log if it has the motion; say where, or nothing."""
    kept = path.with_suffix(".cut.npz")
    try:
        columns, _ = read_whole_entries(part)
        if {"meta", *_REQUIRED} <= set(columns):
            part.replace(kept)
            return f"; what fits is in {kept}: hsp salvage {kept}"
    except OSError:
        pass
    return ""


def _remove(part: Path) -> None:
    with suppress(OSError):  # its folder may be no folder
        part.unlink(missing_ok=True)


def _salvageable(path: Path) -> str:
    """Return what to do with a log that is cut, if something can be done."""
    try:
        columns, _ = read_whole_entries(path)
    except OSError:
        return ""
    whole = {"meta", *_REQUIRED} <= set(columns)
    return f"; its motion is whole: hsp salvage {path}" if whole else ""


def _described(columns: dict[str, Array]) -> list[str]:
    """Return the columns that the entry 'meta' describes, as far as it can be read."""
    try:
        described = json.loads(str(columns["meta"]))["columns"]
    except (KeyError, TypeError, ValueError, RecursionError):
        return []
    return list(described) if isinstance(described, dict) else []


def settle(columns: Mapping[str, Array], continuous: Sequence[int]) -> None:
    """Make rows that were written one by one a whole, in place.

    Positions of continuous joints pass ±π without a jump. Tasks that came on the way
    are, before that, where they first were: what is drawn needs a place. Their errors
    stay NaN there.
    """
    positions, where = columns["joint_positions"], list(continuous)
    positions[:, where] = np.unwrap(positions[:, where], axis=0)
    for name, column in columns.items():
        if name.startswith("task.") and name.endswith((".reference", ".actual")):
            known = np.flatnonzero(np.isfinite(column).all(axis=1))
            if known.size:
                column[: known[0]] = column[known[0]]


def _checked(
    path: Path, columns: dict[str, Array], lost: Sequence[str] = ()
) -> tuple[dict[str, Array], dict[str, Any]]:
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
    if reason := complaint(meta, columns):
        raise LogError(f"{path}: {reason}")
    return {name: np.asarray(c, dtype=float) for name, c in columns.items()}, meta
