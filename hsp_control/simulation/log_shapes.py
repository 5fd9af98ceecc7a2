"""The required form of a log's columns, on which all readers can rely."""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LogError
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log_meta import drawn_widths

_REQUIRED = ("t", "q", "v", "tau")
_OF_JOINTS = (
    "v", "tau", "acceleration", "joint_positions", "field.g", "null_space_error",
    POSITION, VELOCITY,
)  # fmt: skip
_NUMBERS = (
    "field.value", "null_space_norm", "manipulability", "damped", "status",
    "relaxation",
)  # fmt: skip
_MEASURED = "distance.", "barrier."
"""How the columns of single numbers begin that terms and limits measure."""
_FINITE = ("t", "q", "v", "joint_positions", "skeleton")


class WrongColumnError(LogError):
    """An invalid column of a log."""


def check_columns(columns: Mapping[str, Array], meta: Mapping[str, Any]) -> None:
    """Check lengths, shapes and times of a log's columns, whose metadata are checked.

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
    expected, vectors = dict(_shapes(meta)), dict(_vectors(meta))
    for name, values in columns.items():
        if name in expected:
            _check_shape(name, values, (rows, *expected[name]))
        elif name in vectors:
            _check_vectors(name, values, rows, vectors[name])
        elif values.ndim < 1 or len(values) != rows:
            raise WrongColumnError(
                f"the column {name!r} has shape {values.shape}; needs {rows} rows"
            )
        if name in _FINITE or name.startswith("obstacle."):
            finite = np.isfinite(values).all(axis=tuple(range(1, values.ndim)))
            if not finite.all():
                row = int(np.flatnonzero(~finite)[0])
                raise WrongColumnError(
                    f"the column {name!r} is not finite in row {row}: {values[row]}"
                )
    for name in meta.get("tasks", {}):
        reference = columns.get(f"task.{name}.reference")
        if reference is not None and f"task.{name}.actual" in columns:
            actual = f"task.{name}.actual"
            _check_shape(actual, columns[actual], reference.shape)
    back = np.flatnonzero(np.diff(columns["t"]) < 0.0)
    if back.size:
        k = int(back[0])
        t = columns["t"]
        raise WrongColumnError(
            f"the time runs back from {t[k]:g} to {t[k + 1]:g} s in row {k + 1}"
        )


def _check_shape(name: str, values: Array, needed: tuple[int, ...]) -> None:
    if values.shape != needed:
        raise WrongColumnError(
            f"the column {name!r} has shape {values.shape}; needs {needed}"
        )


def _check_vectors(name: str, values: Array, rows: int, least: int) -> None:
    """Check a column of vectors, of at least some length."""
    if values.ndim != 2 or len(values) != rows or values.shape[1] < least:
        more = f" with n of {least} or more" if least else ""
        raise WrongColumnError(
            f"the column {name!r} has shape {values.shape}; needs ({rows}, n){more}"
        )


def _vectors(meta: Mapping[str, Any]) -> Iterator[tuple[str, int]]:
    """Yield the least length of the columns of vectors whose length is not known."""
    yield "singular_values", 0
    for name, task in meta.get("tasks", {}).items():
        least = sum(drawn_widths(task).values())
        yield f"task.{name}.reference", least
        yield f"task.{name}.actual", least


def _shapes(meta: Mapping[str, Any]) -> Iterator[tuple[str, tuple[int, ...]]]:
    """Yield the shape of a row of each column that is known."""
    robot = meta.get("robot", {})
    yield "t", ()
    if "nq" in robot:
        yield "q", (robot["nq"],)
    if "nv" in robot:
        for name in _OF_JOINTS:
            yield name, (robot["nv"],)
    for name in _NUMBERS:
        yield name, ()
    for name in meta.get("columns", {}):
        term = name.startswith("field.")
        if term and name.endswith(".g") and "nv" in robot:
            yield name, (robot["nv"],)
        elif name.startswith(_MEASURED) or (term and name.endswith(".value")):
            yield name, ()
    if "skeleton_parents" in robot:
        yield "skeleton", (len(robot["skeleton_parents"]), 3)
    for name in meta.get("obstacles", {}):
        yield f"obstacle.{name}", (3,)
        yield f"obstacle.{name}.quaternion", (4,)
    for name, task in meta.get("tasks", {}).items():
        for of_rows in ("error", "error_rate", "stiffness"):
            yield f"task.{name}.{of_rows}", (task["rows"],)
        yield f"task.{name}.bounded", ()
