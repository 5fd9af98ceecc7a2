"""What a log says of itself: checked against its columns before anybody believes it.

Only what readers rely on is checked. How the run ended and what the robot is must be
there; of the rest a log may say less, and a user's own data may say more.
"""

import math
from collections.abc import Iterator
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import SceneError
from hsp_control.geometry.shapes import described_shape

_MOTION = ("t", "q", "v", "tau")
_PLACED = {*_MOTION, "joint_positions", "skeleton"}
"""What is drawn in space or over time: it needs a place."""
_FARTHEST, _LARGEST = 1e12, 1e100
"""What the axes of a picture can tell apart; motion that diverges ends long before."""

_NORM = 1e-6
_LONGEST = 1e4

Finite = Annotated[float, Field(allow_inf_nan=False)]
Count = Annotated[int, Field(ge=1, le=100_000)]


class _Model(BaseModel):
    model_config = ConfigDict(extra="allow", strict=True)


class _Column(_Model):
    unit: str = "-"
    meaning: str = ""


class _Robot(_Model):
    name: str
    nq: Count | None = None
    nv: Count | None = None
    dofs: list[str]
    units: list[str]
    skeleton_parents: Annotated[list[Annotated[int, Field(ge=-1)]], Field(min_length=1)]
    joint_coordinates: str | None = None


class _Task(_Model):
    type: str = ""
    rows: Annotated[int, Field(ge=0)] | None = None
    level: Annotated[int, Field(ge=0)] | None = None
    axes: Annotated[str, Field(pattern="^[xyz]{1,3}$")] | None = None
    frame: str | None = None


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


def complaint(meta: dict[str, Any], columns: dict[str, Array]) -> str:
    """Return what is wrong with a log's description or its columns, or nothing."""
    try:
        told = _Meta.model_validate(meta)
    except ValidationError as error:
        first = error.errors(include_url=False)[0]
        place = ".".join(str(part) for part in first["loc"])
        if first["type"] == "missing":
            return f"its entry 'meta' does not say {place!r}"
        return f"its entry 'meta' says nonsense at {place!r}: {first['msg']}"
    except RecursionError:
        return "its entry 'meta' is nested too deeply"
    return (
        _wrong_columns(columns)
        or _wrong_shapes(told, columns)
        or _wrong_robot(told, columns)
    )


def _wrong_columns(columns: dict[str, Array]) -> str:
    for name, column in columns.items():
        if column.dtype.kind not in "fiub":
            return f"its column {name!r} holds no numbers"
        if 0 in column.shape[1:]:
            return f"its column {name!r} has no number in a row"
        placed = (
            name in _PLACED
            or name.startswith("obstacle.")
            or (name.startswith("task.") and name.endswith((".reference", ".actual")))
        )
        if placed and not np.isfinite(column).all():
            return f"its column {name!r} holds a NaN or an infinity"
        largest = np.abs(column[np.isfinite(column)], dtype=float).max(initial=0.0)
        if largest > (_FARTHEST if placed else _LARGEST):
            return f"its column {name!r} holds {largest:.3g}, no number of a robot"
    for name in _MOTION:
        dimensions = 1 if name == "t" else 2
        if columns[name].ndim != dimensions:
            return f"its column {name!r} has {columns[name].ndim} dimensions"
    if (np.diff(columns["t"]) < 0.0).any():
        return "its time runs backwards"
    return ""


def _wrong_shapes(told: _Meta, columns: dict[str, Array]) -> str:
    nq, nv = columns["q"].shape[1], columns["v"].shape[1]
    points = len(told.robot.skeleton_parents) or None
    wanted: dict[str, tuple[int | None, ...]] = {
        "q": (told.robot.nq or nq,),
        "v": (told.robot.nv or nv,),
        **dict.fromkeys(("tau", "acceleration", "joint_positions"), (nv,)),
        **dict.fromkeys(("field.g", "null_space_error"), (nv,)),
        **dict.fromkeys(("field.value", "null_space_norm", "manipulability"), ()),
        **dict.fromkeys(("damped", "status", "relaxation"), ()),
        "singular_values": (None,),
        "skeleton": (points, 3),
    }
    for task, about in told.tasks.items():
        for what in ("error", "error_rate"):
            wanted[f"task.{task}.{what}"] = (about.rows,)
        for what in ("reference", "actual"):
            wanted[f"task.{task}.{what}"] = (_width(about),)
    for obstacle in told.obstacles:
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
                f"its column {name!r} has rows of shape {found}; what it says of "
                f"itself needs {tuple('any' if n is None else n for n in shape)}"
            )
    return ""


def _wrong_robot(told: _Meta, columns: dict[str, Array]) -> str:
    robot, nv = told.robot, columns["v"].shape[1]
    for name in ("freedoms", "units"):
        given = getattr(robot, name)
        if len(given) != nv:
            return f"its robot has {len(given)} {name}, its motion {nv}"
    if any(parent >= k for k, parent in enumerate(robot.skeleton_parents)):
        return "a point of its skeleton comes before its parent"
    for name in ("null_space_gain", "metric_matrix"):
        matrix = getattr(told, name)
        if matrix is not None and [len(row) for row in matrix] != [nv] * nv:
            return f"its {name} is not of shape ({nv}, {nv})"
    matrix = told.metric_matrix
    if matrix is not None and not _definite(np.array(matrix)):
        return "its metric_matrix is not symmetric positive definite"
    for name, part in _quaternions(told, columns):
        if not (np.abs(np.linalg.norm(part, axis=1) - 1.0) < _NORM).all():
            return f"its column {name!r} holds what is no orientation"
    for name, obstacle in told.obstacles.items():
        if reason := _wrong_obstacle(obstacle):
            return f"its obstacle {name!r} {reason}"
        if f"obstacle.{name}" not in columns:
            return f"the log lacks the column 'obstacle.{name}'"
    for name, task in told.tasks.items():
        if task.type == "FramePosition" and task.axes is None:
            return f"its entry 'meta' does not say 'tasks.{name}.axes'"
    return ""


def _wrong_obstacle(about: _Obstacle) -> str:
    if about.radius is not None and not 0.0 <= about.radius < math.inf:
        return f"has the radius {about.radius}"
    if not _drawable(about.parameters):
        return "has parameters that no obstacle has"
    try:
        shape = described_shape(about.shape, about.parameters)
    except SceneError as error:
        return f"is no shape: {error}"
    if shape is None and about.radius is None:
        return "has neither a known shape nor a radius"
    return ""


def _quaternions(told: _Meta, columns: dict[str, Array]) -> Iterator[tuple[str, Array]]:
    """Yield the columns that hold quaternions, and where in them."""
    for name, column in columns.items():
        if name.startswith("obstacle.") and name.endswith(".quaternion"):
            yield name, column
    for task, about in told.tasks.items():
        for what in ("reference", "actual"):
            name = f"task.{task}.{what}"
            if name in columns and _width(about) in (4, 7):
                yield name, columns[name][:, -4:]


def _drawable(value: Any) -> bool:
    """Say whether all numbers in plain data are lengths of an obstacle [m]."""
    if isinstance(value, dict):
        return all(_drawable(inner) for inner in value.values())
    if isinstance(value, list):
        return all(_drawable(inner) for inner in value)
    return not isinstance(value, int | float) or abs(value) <= _LONGEST


def _definite(matrix: Array) -> bool:
    symmetric = bool(np.allclose(matrix, matrix.T))
    return symmetric and bool(np.linalg.eigvalsh(matrix)[0] > 0.0)


def _width(task: _Task) -> int | None:
    """Return how many numbers a task's reference has, where that is known."""
    known = {"FramePose": 7, "FrameOrientation": 4}
    if task.type == "FramePosition" and task.axes is not None:
        return len(task.axes)
    return known.get(task.type)
