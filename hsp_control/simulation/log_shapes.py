"""The required form of a log's columns, on which all readers can rely."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import LogError

_REQUIRED = ("t", "q", "v", "tau")
_OF_JOINTS = (
    "v", "tau", "acceleration", "joint_positions", "field.g", "null_space_error",
)  # fmt: skip
_NUMBERS = (
    "field.value", "null_space_norm", "manipulability", "damped", "status",
    "relaxation",
)  # fmt: skip
_FINITE = ("t", "q", "v", "joint_positions", "skeleton")


class WrongColumnError(LogError):
    """An invalid column of a log."""


def check_columns(columns: Mapping[str, Array], meta: Mapping[str, Any]) -> None:
    """Check lengths, shapes and times of a log's columns.

    Raises:
        WrongColumnError: If one is missing, has another shape or length than it must
            have, or is not finite where it has to be; or times run back.
    """
    if not columns:
        raise WrongColumnError("the log has no rows: its run ended before the first")
    for name in _REQUIRED:
        if name not in columns:
            raise WrongColumnError(f"the log lacks the column {name!r}")
    if columns["t"].ndim != 1:
        shape = columns["t"].shape
        raise WrongColumnError(f"the column 't' has shape {shape}; needs (rows,)")
    rows = len(columns["t"])
    expected = dict(_shapes(meta))
    for name, values in columns.items():
        needed = expected.get(name)
        if needed is None:
            if values.ndim < 1 or len(values) != rows:
                raise WrongColumnError(
                    f"the column {name!r} has shape {values.shape}; needs {rows} rows"
                )
        elif values.shape != (rows, *needed):
            raise WrongColumnError(
                f"the column {name!r} has shape {values.shape}; needs {(rows, *needed)}"
            )
        if name in _FINITE or name.startswith("obstacle."):
            finite = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
            if not finite.all():
                row = int(np.flatnonzero(~finite)[0])
                raise WrongColumnError(
                    f"the column {name!r} is not finite in row {row}: {values[row]}"
                )
    back = np.flatnonzero(np.diff(columns["t"]) < 0.0)
    if back.size:
        k = int(back[0])
        t = columns["t"]
        raise WrongColumnError(
            f"the time runs back from {t[k]:g} to {t[k + 1]:g} s in row {k + 1}"
        )


def _shapes(meta: Mapping[str, Any]) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield the shape of a row of each column that is known."""
    robot = _mapping(meta, "robot")
    yield "t", ()
    if "nq" not in robot and "nv" not in robot:
        return
    sizes = robot.get("nq"), robot.get("nv")
    if not all(type(size) is int for size in sizes):
        raise WrongColumnError(f"the robot has nq, nv = {sizes}; needs two integers")
    yield "q", (robot["nq"],)
    for name in _OF_JOINTS:
        yield name, (robot["nv"],)
    for name in _NUMBERS:
        yield name, ()
    parents = robot.get("skeleton_parents", ())
    if not isinstance(parents, list | tuple):
        raise WrongColumnError("skeleton_parents is no list")
    yield "skeleton", (len(parents), 3)
    for name in _mapping(meta, "obstacles"):
        yield f"obstacle.{name}", (3,)
        yield f"obstacle.{name}.quaternion", (4,)
    for name, about in _mapping(meta, "tasks").items():
        count = about.get("rows") if isinstance(about, Mapping) else None
        if type(count) is not int:
            raise WrongColumnError(f"the task {name!r} has no number of rows")
        yield f"task.{name}.error", (count,)
        yield f"task.{name}.error_rate", (count,)


def _mapping(meta: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = meta.get(name, {})
    if not isinstance(found, Mapping):
        raise WrongColumnError(f"{name} is {type(found).__name__}; needs a mapping")
    return found
