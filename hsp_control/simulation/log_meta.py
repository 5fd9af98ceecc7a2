"""The required form of a log's metadata, on which all readers can rely."""

from collections.abc import Mapping
from numbers import Real
from typing import Any

from hsp_control.common.errors import LogError
from hsp_control.common.suggestions import listing

_Kinds = type | tuple[type, ...]
_NONE = type(None)
_LIST = (list, tuple)
_KINDS: Mapping[str, tuple[_Kinds, str]] = {
    "status": (str, "text"),
    "message": (str, "text"),
    "columns": (Mapping, "a mapping"),
    "robot": (Mapping, "a mapping"),
    "limits": (Mapping, "a mapping"),
    "tasks": (Mapping, "a mapping"),
    "obstacles": (Mapping, "a mapping"),
    "versions": (Mapping, "a mapping"),
    "config": ((Mapping, _NONE), "a mapping or null"),
    "plant": ((Mapping, _NONE), "a mapping or null"),
    "imported": ((Mapping, _NONE), "a mapping or null"),
    "streams": ((Mapping, _NONE), "a mapping or null"),
    "plan_streams": ((*_LIST, _NONE), "a list or null"),
    "changes": ((*_LIST, _NONE), "a list or null"),
    "controls_null_space": (bool, "true or false"),
}
_OF_MAPPINGS = "columns", "tasks", "obstacles"
"""Entries whose values are mappings, too."""
_OF_ROBOT: Mapping[str, tuple[_Kinds, str]] = {
    "name": (str, "text"),
    "nq": (int, "an integer"),
    "nv": (int, "an integer"),
    "dofs": (_LIST, "a list"),
    "units": (_LIST, "a list"),
    "continuous": (_LIST, "a list"),
    "skeleton_parents": (_LIST, "a list"),
}
_ALWAYS = "status", "robot"
"""Entries without which nothing can be drawn; logs without others can be."""

DRAWN_WIDTHS = {"position": 3, "orientation": 4, "direction": 3}
"""The columns of what can be drawn of a task's reference; a position has one per axis
that the task tracks."""


class WrongMetaError(LogError):
    """Invalid metadata of a log."""


def drawn_widths(task: Mapping[str, Any]) -> dict[str, int]:
    """Return how many columns of a task's reference show which quantity, in order."""
    drawn = {part: DRAWN_WIDTHS[part] for part in task.get("drawn") or ()}
    if "position" in drawn and (axes := task.get("axes")):
        drawn["position"] = len(axes)
    return drawn


def check_kinds(meta: Mapping[str, Any]) -> None:
    """Check the kinds of the entries that there are.

    Raises:
        WrongMetaError: If one is of another kind than readers expect.
    """
    _check_entries(meta, _KINDS, "")
    for name in _OF_MAPPINGS:
        for key, value in meta.get(name, {}).items():
            _check(value, Mapping, "a mapping", f"{name}: {key}")
    robot = meta.get("robot", {})
    _check_entries(robot, _OF_ROBOT, "robot: ")
    if type(nv := robot.get("nv")) is int:
        _check_robot(robot, nv)
        _check_limits(meta.get("limits", {}), nv)
        for name in ("null_space_gain", "metric_matrix"):
            _check_matrix(meta.get(name), nv, name)
    for name, task in meta.get("tasks", {}).items():
        _check_task(task, f"tasks: {name}: ")


def check_complete(meta: Mapping[str, Any]) -> None:
    """Check that the entries are there that every reader needs.

    Raises:
        WrongMetaError: If one is missing.
    """
    for name in _ALWAYS:
        if name not in meta:
            raise WrongMetaError(f"the log has no {name!r} (it has {listing(meta)})")
    check_robot(meta)


def check_robot(meta: Mapping[str, Any]) -> None:
    """Check that the description of the robot is complete.

    Raises:
        WrongMetaError: If an entry is missing.
    """
    robot = meta.get("robot", {})
    for name in _OF_ROBOT:
        if name not in robot:
            raise WrongMetaError(
                f"the log's robot has no {name!r} (it has {listing(robot)})"
            )


def _check_entries(
    found: Mapping[str, Any], kinds: Mapping[str, tuple[_Kinds, str]], where: str
) -> None:
    for name, (kind, words) in kinds.items():
        if name in found:
            _check(found[name], kind, words, f"{where}{name}")


def _check(value: Any, kind: _Kinds, words: str, where: str) -> None:
    # JSON's true is no number.
    if not isinstance(value, kind) or (kind is int and isinstance(value, bool)):
        raise WrongMetaError(f"{where} is {value!r:.80}; needs {words}")


def _check_robot(robot: Mapping[str, Any], nv: int) -> None:
    for name in ("dofs", "units"):
        names = robot.get(name)
        if names is not None and not (_are(names, str) and len(names) == nv):
            raise WrongMetaError(f"robot: {name} is {names!r:.80}; needs {nv} texts")
    dofs, parents = robot.get("continuous", ()), robot.get("skeleton_parents", ())
    if not (_are(dofs, int) and all(0 <= dof < nv for dof in dofs)):
        raise WrongMetaError(
            f"robot: continuous is {dofs!r:.80}; needs numbers of dofs, 0 to {nv - 1}"
        )
    points = len(parents)
    if not (_are(parents, int) and all(-1 <= parent < points for parent in parents)):
        raise WrongMetaError(
            f"robot: skeleton_parents is {parents!r:.80}; needs numbers of points, "
            f"-1 to {points - 1}"
        )


def _check_limits(limits: Mapping[str, Any], nv: int) -> None:
    for name, values in limits.items():
        if values is not None and not (
            isinstance(values, _LIST)
            and len(values) == nv
            and all(value is None or _is_number(value) for value in values)
        ):
            raise WrongMetaError(
                f"limits: {name} is {values!r:.80}; needs {nv} numbers or nulls"
            )


def _check_matrix(value: Any, nv: int, where: str) -> None:
    """Check a number, or a square matrix of dofs, or nothing."""
    if value is None or _is_number(value):
        return
    rows = value if isinstance(value, _LIST) else ()
    if len(rows) != nv or not all(
        isinstance(row, _LIST) and len(row) == nv and all(map(_is_number, row))
        for row in rows
    ):
        raise WrongMetaError(f"{where} is {value!r:.80}; needs {nv} x {nv} numbers")


def _check_task(task: Mapping[str, Any], where: str) -> None:
    rows, drawn = task.get("rows"), task.get("drawn") or ()
    if type(rows) is not int or rows < 0:
        raise WrongMetaError(f"{where}rows is {rows!r:.80}; needs a number of rows")
    if not (_are(drawn, str) and set(drawn) <= set(DRAWN_WIDTHS)):
        raise WrongMetaError(
            f"{where}drawn is {drawn!r:.80}; needs a list of {listing(DRAWN_WIDTHS)}"
        )
    axes = task.get("axes") or "xyz"
    known = isinstance(axes, str) and set(axes) <= set("xyz")
    if "position" in drawn and not known:
        raise WrongMetaError(f"{where}axes is {axes!r:.80}; needs axes such as 'xz'")
    for part in _list_of(task.get("error") or (), f"{where}error"):
        if not (
            isinstance(part, _LIST)
            and len(part) == 4
            and _are(part[:3], str)
            and type(part[3]) is int
        ):
            raise WrongMetaError(
                f"{where}error has {part!r:.80}; needs a name, two units and a number "
                "of rows"
            )


def _list_of(value: Any, where: str) -> list[Any]:
    _check(value, _LIST, "a list", where)
    return list(value)


def _are(values: Any, kind: type) -> bool:
    return isinstance(values, _LIST) and all(type(value) is kind for value in values)


def _is_number(value: Any) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
