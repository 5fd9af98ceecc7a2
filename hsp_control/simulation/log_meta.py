"""Checks the meta data of an untrusted log, also against the log's columns.

Only what the readers of logs rely on is checked. The status and the robot are required.
Other entries may be missing, and a user may add entries.
"""

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.geometry.shapes import shape_from_log

_MOTION = ("t", "q", "v", "tau")
_DRAWN = {*_MOTION, "joint_positions", "skeleton"}
"""Columns that are drawn in space or over time: they must be finite."""
_MAX_DRAWN, _MAX_VALUE = 1e12, 1e100
"""Largest values of drawn and of other columns.

The axes of a plot cannot resolve larger ones. A motion that diverges ends long before.
"""
_NORM_TOLERANCE = 1e-6
"""Tolerance of a quaternion's norm."""
_MAX_LENGTH = 1e4
"""Largest length in the parameters of an obstacle [m]."""

_POSITION, _ORIENTATION = ("position", "m", "m/s"), ("orientation", "rad", "rad/s")
_OLD_TASKS: dict[str, tuple[tuple[tuple[Any, ...], ...], tuple[str, ...]]] = {
    "FramePosition": (((*_POSITION, None),), ("position",)),
    "FrameOrientation": (((*_ORIENTATION, 3),), ("orientation",)),
    "FramePose": (((*_POSITION, 3), (*_ORIENTATION, 3)), ("position", "orientation")),
    "RelativePose": (((*_POSITION, 3), (*_ORIENTATION, 3)), ()),
    "Pointing": ((("tan of half the angle", "-", "1/s", 2),), ("direction",)),
    "JointPosture": ((("joints", "rad or m", "rad/s or m/s", None),), ()),
    "CenterOfMass": (((*_POSITION, None),), ()),
    "AngularMomentum": ((("angular momentum", "m²/s", "m²/s²", 3),), ()),
}
"""What version 0.1 did not log: the parts of a task's error, each with its size (None:
all rows), and what can be drawn; by class."""

Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=100_000)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class _Column(_Model):
    unit: str = "-"
    meaning: str = ""
    center_of: str = ""


class _Robot(_Model):
    name: str
    nq: Count | None = None
    nv: Count | None = None
    dofs: list[str]
    units: list[str]
    skeleton_parents: Annotated[list[Annotated[int, Field(ge=-1)]], Field(min_length=1)]
    joint_coordinates: str | None = None


_ErrorPart = Annotated[tuple[str, str, str, Count], Field(strict=False)]
"""Name, unit, unit of the rate, number of components; JSON has it as a list."""


class _Task(_Model):
    type: str = ""
    rows: Annotated[int, Field(ge=0)] | None = None
    level: Annotated[int, Field(ge=0)] | None = None
    error: Annotated[list[_ErrorPart], Field(min_length=1)] | None = None
    drawn: list[Literal["position", "orientation", "direction"]] = []
    axes: Annotated[str, Field(pattern="^[xyz]{1,3}$")] | None = None
    frame: str | None = None

    @property
    def error_width(self) -> int | None:
        """Number of rows of the error; None if that is not known."""
        return self.rows if self.error is None else sum(n for *_, n in self.error)

    @property
    def drawn_columns(self) -> dict[str, slice]:
        """The columns of the reference that can be drawn, by what they are."""
        return drawn_columns(self.drawn, self.axes)

    @property
    def reference_width(self) -> int | None:
        """How many numbers the reference has; None if that is not known."""
        return max((part.stop for part in self.drawn_columns.values()), default=None)


class _Obstacle(_Model):
    shape: str = ""
    parameters: dict[str, Any] = {}
    radius: Finite | None = None


class _Meta(_Model):
    format: str
    status: Literal["completed", "interrupted", "stopped", "diverged"]
    message: str = ""
    name: str = ""
    title: str = ""
    columns: dict[str, _Column] = {}
    robot: _Robot
    tasks: dict[str, _Task] = {}
    field: str = ""
    controls_null_space: bool = True
    null_space_gain: list[list[Finite]] | None = None
    metric: str = ""
    metric_matrix: list[list[Finite]] | None = None
    obstacles: dict[str, _Obstacle] = {}
    versions: dict[str, str] = {}
    config: dict[str, Any] | None = None


def renamed_entries(meta: dict[str, Any]) -> dict[str, Any]:
    """Return the meta data of a log with the entries of this version.

    Logs of version 0.1 have ``robot.freedoms`` instead of ``robot.dofs``, and the class
    of a task instead of ``error`` and ``drawn``.
    """
    robot, tasks = meta.get("robot"), meta.get("tasks")
    if isinstance(robot, dict) and "freedoms" in robot and "dofs" not in robot:
        names = {"freedoms": "dofs"}
        robot = {names.get(name, name): entry for name, entry in robot.items()}
        meta = {**meta, "robot": robot}
    if isinstance(tasks, dict) and tasks:
        tasks = {name: _renamed_task(task) for name, task in tasks.items()}
        meta = {**meta, "tasks": tasks}
    return meta


def _renamed_task(task: Any) -> Any:
    """Return the meta data of a task with the entries of this version."""
    if not isinstance(task, dict) or "error" in task:
        return task
    error, drawn = _OLD_TASKS.get(str(task.get("type")), ((), ()))
    parts = [[*part, size or task.get("rows")] for *part, size in error]
    if not parts or None in parts[0]:
        return task
    return {**task, "error": parts, "drawn": list(drawn)}


def drawn_columns(drawn: Sequence[str], axes: str | None) -> dict[str, slice]:
    """Return the columns of a task's reference that can be drawn, by what they are.

    Args:
        drawn: What they are, in order; see `Task.drawn`.
        axes: The world axes of a position; None: all three.
    """
    position = 3 if axes is None else len(axes)
    widths = {"position": position, "orientation": 4, "direction": 3}
    ends = list(accumulate((widths[part] for part in drawn), initial=0))
    return {part: slice(*ends[k : k + 2]) for k, part in enumerate(drawn)}


def find_fault(meta: dict[str, Any], columns: dict[str, Array]) -> str:
    """Return the first fault of a log's meta data or columns, "" if there is none.

    Args:
        meta: The meta data, as JSON data.
        columns: The columns by name, N rows each; t, q, v and tau must be there.
    """
    try:
        parsed = _Meta.model_validate(meta)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        if first["type"] == "missing":
            return f"its entry 'meta' lacks {place!r}"
        return f"its entry 'meta' is wrong at {place!r}: {first['msg']}"
    except RecursionError:
        return "its entry 'meta' is nested too deeply"
    return (
        _fault_of_columns(columns)
        or _fault_of_shapes(parsed, columns)
        or _fault_of_meta(parsed, columns)
    )


def drawable_rows(columns: dict[str, Array]) -> Array:
    """Return which rows have numbers that a log may have, shape (N,), booleans.

    A row that a loop wrote of an absurd state must not make its journal unreadable.

    Args:
        columns: The columns by name, N rows each.
    """
    drawable = np.ones(len(columns["t"]), dtype=bool)
    for name, column in columns.items():
        size = np.abs(column.reshape(len(column), math.prod(column.shape[1:])))
        if _is_drawn(name):
            drawable &= (size <= _MAX_DRAWN).all(axis=1)  # neither is NaN
        else:
            drawable &= ~((size > _MAX_VALUE) & np.isfinite(size)).any(axis=1)
    return drawable


def _is_drawn(name: str) -> bool:
    return (
        name in _DRAWN
        or name.startswith("obstacle.")
        or (name.startswith("task.") and name.endswith((".reference", ".actual")))
    )


def _fault_of_columns(columns: dict[str, Array]) -> str:
    for name, column in columns.items():
        if column.dtype.kind not in "fiub":
            return f"its column {name!r} does not hold numbers"
        if 0 in column.shape[1:]:
            return f"its column {name!r} has rows without numbers"
        drawn = _is_drawn(name)
        if drawn and not np.isfinite(column).all():
            return f"its column {name!r} contains NaN or inf"
        largest = np.abs(column[np.isfinite(column)], dtype=float).max(initial=0.0)
        limit = _MAX_DRAWN if drawn else _MAX_VALUE
        if largest > limit:
            return (
                f"its column {name!r} contains {largest:.3g}, which is too large "
                f"(at most {limit:.0e})"
            )
    for name in _MOTION:
        dimensions = 1 if name == "t" else 2
        if columns[name].ndim != dimensions:
            return (
                f"its column {name!r} has {columns[name].ndim} dimensions; needs "
                f"{dimensions}"
            )
    if (np.diff(columns["t"]) < 0.0).any():
        return "its time decreases"
    return ""


def _fault_of_shapes(meta: _Meta, columns: dict[str, Array]) -> str:
    nq, nv = columns["q"].shape[1], columns["v"].shape[1]
    points = len(meta.robot.skeleton_parents) or None
    wanted: dict[str, tuple[int | None, ...]] = {
        "q": (meta.robot.nq or nq,),
        "v": (meta.robot.nv or nv,),
        **dict.fromkeys(("tau", "acceleration", "joint_positions"), (nv,)),
        **dict.fromkeys(("field.g", "null_space_error"), (nv,)),
        **dict.fromkeys(("field.value", "null_space_norm", "manipulability"), ()),
        **dict.fromkeys(("damped", "status", "relaxation"), ()),
        "singular_values": (None,),
        "skeleton": (points, 3),
    }
    for name, task in meta.tasks.items():
        for part in ("error", "error_rate"):
            wanted[f"task.{name}.{part}"] = (task.error_width,)
        for part in ("reference", "actual"):
            wanted[f"task.{name}.{part}"] = (task.reference_width,)
    for obstacle in meta.obstacles:
        wanted[f"obstacle.{obstacle}"] = (3,)
        wanted[f"obstacle.{obstacle}.quaternion"] = (4,)
    for name in columns:
        if name.startswith("field.") and name.endswith(".g"):
            wanted[name] = (nv,)
        elif name.startswith("distance.") or name.endswith(".value"):
            wanted[name] = ()
    for name, shape in wanted.items():
        found = columns[name].shape[1:] if name in columns else shape
        if len(found) != len(shape) or any(
            size is not None and size != here
            for size, here in zip(shape, found, strict=True)
        ):
            return (
                f"its column {name!r} has rows of shape {found}; the entry 'meta' "
                f"needs {tuple('any' if n is None else n for n in shape)}"
            )
    return ""


def _fault_of_meta(meta: _Meta, columns: dict[str, Array]) -> str:
    robot, nv = meta.robot, columns["v"].shape[1]
    for name in ("dofs", "units"):
        given = getattr(robot, name)
        if len(given) != nv:
            return f"its robot has {len(given)} {name}, its column 'v' has {nv}"
    if any(parent >= k for k, parent in enumerate(robot.skeleton_parents)):
        return "a point of its skeleton is listed before its parent"
    for name in ("null_space_gain", "metric_matrix"):
        matrix = getattr(meta, name)
        if matrix is not None and [len(row) for row in matrix] != [nv] * nv:
            return f"its {name} does not have the shape ({nv}, {nv})"
    matrix = meta.metric_matrix
    if matrix is not None and not _is_positive_definite(np.array(matrix)):
        return "its metric_matrix is not symmetric positive definite"
    for name, quaternions in _quaternions(meta, columns):
        errors = np.abs(np.linalg.norm(quaternions, axis=1) - 1.0)
        if not (errors < _NORM_TOLERANCE).all():
            return f"its column {name!r} contains a quaternion that is not of unit norm"
    for name, obstacle in meta.obstacles.items():
        if reason := _fault_of_obstacle(obstacle):
            return f"its obstacle {name!r} {reason}"
        if f"obstacle.{name}" not in columns:
            return f"the log lacks the column 'obstacle.{name}'"
    for name, task in meta.tasks.items():
        if task.rows not in {None, task.error_width}:
            return (
                f"its task {name!r} has {task.rows} rows; the parts of its error have "
                f"{task.error_width}"
            )
    return ""


def _fault_of_obstacle(obstacle: _Obstacle) -> str:
    if obstacle.radius is not None and not 0.0 <= obstacle.radius < math.inf:
        return f"has the radius {obstacle.radius}; must not be negative"
    if not _lengths_are_drawable(obstacle.parameters):
        return f"has a parameter that is too large (at most {_MAX_LENGTH:g} m)"
    try:
        shape = shape_from_log(obstacle.shape, obstacle.parameters)
    except SceneError as error:
        return f"has wrong parameters: {error}"
    if shape is None and obstacle.radius is None:
        return "has neither a known shape nor a radius"
    return ""


def _quaternions(meta: _Meta, columns: dict[str, Array]) -> Iterator[tuple[str, Array]]:
    """Yield the name of every column with quaternions, and those, shape (N, 4)."""
    for name, column in columns.items():
        if name.startswith("obstacle.") and name.endswith(".quaternion"):
            yield name, column
    for name, task in meta.tasks.items():
        where = task.drawn_columns.get("orientation")
        for key in (f"task.{name}.reference", f"task.{name}.actual"):
            if where is not None and key in columns:
                yield key, columns[key][:, where]


def _lengths_are_drawable(value: Any) -> bool:
    """Return whether all numbers in JSON data are at most `_MAX_LENGTH`."""
    if isinstance(value, dict):
        return all(_lengths_are_drawable(inner) for inner in value.values())
    if isinstance(value, list):
        return all(_lengths_are_drawable(inner) for inner in value)
    return not isinstance(value, int | float) or abs(value) <= _MAX_LENGTH


def _is_positive_definite(matrix: Array) -> bool:
    symmetric = bool(np.allclose(matrix, matrix.T))
    return symmetric and bool(np.linalg.eigvalsh(matrix)[0] > 0.0)
