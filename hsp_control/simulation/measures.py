"""Measures of a run from its log: errors, forces, units, and summary numbers."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log import Log

_EFFORT_UNITS = {"rad": "N·m", "m": "N"}


class LoggedErrorPart(NamedTuple):
    """The components of a task's error that have the same unit."""

    # the task's name, and the name of the part if there are several, or if it has no
    # unit
    label: str
    unit: str  # the components' unit
    task: int  # the task's index among the tasks
    norm: Array  # the components' Euclidean norm at every row, shape (N,)


def task_names(rollout: Log) -> list[str]:
    """Return the tasks' names in the controller's order."""
    return list(rollout.meta.get("tasks", {}))


def task_errors(rollout: Log) -> list[LoggedErrorPart]:
    """Return the norms of all tasks' errors, with metres and radians separate."""
    found = []
    for index, name in enumerate(task_names(rollout)):
        error, first = rollout[f"task.{name}.error"], 0
        whole = ("", column_unit(rollout, f"task.{name}.error"), "", error.shape[1])
        parts = rollout.meta["tasks"][name].get("error") or [whole]
        for part, declared, _, size in parts:
            unit = {"-": "–", "rad or m": position_unit(rollout)}.get(
                declared, declared
            )
            label = f"{name} {part}" if len(parts) > 1 or unit == "–" else name
            norm = np.linalg.norm(error[:, first : first + size], axis=1)
            found.append(LoggedErrorPart(label.strip(), unit, index, norm))
            first += size
    return found


def position_units(rollout: Log) -> list[str]:
    """Return the units of the dofs' positions: ``rad`` or ``m``."""
    return list(map(str, rollout.meta["robot"]["units"]))


def position_unit(rollout: Log) -> str:
    """Return the unit of all joints' positions: ``rad``, ``m`` or ``rad, m``."""
    return ", ".join(dict.fromkeys(position_units(rollout)))


def rate_unit(rollout: Log) -> str:
    """Return the unit of a norm of joint rates: ``rad/s``, ``m/s``, ``(rad, m)/s``."""
    unit = position_unit(rollout)
    return f"({unit})/s" if " " in unit else f"{unit}/s"


def effort_units(rollout: Log) -> list[str]:
    """Return the units of the dofs' efforts: ``N·m`` or ``N``."""
    return [_EFFORT_UNITS.get(unit, "–") for unit in position_units(rollout)]


def effort_unit(rollout: Log) -> str:
    """Return the unit of all efforts: ``N·m``, ``N``, or as the log has it."""
    unit = position_unit(rollout)
    return _EFFORT_UNITS.get(unit) or column_unit(rollout, "tau")


def has_law(rollout: Log) -> bool:
    """Return whether the law is in the log: a robot's own has states only."""
    return bool(np.isfinite(rollout["null_space_norm"]).any())


def rows_compare(rollout: Log) -> bool:
    """Return whether the number of the tasks' rows is constant.

    Determinants of different sizes cannot be compared.
    """
    sizes = np.isfinite(rollout["singular_values"]).sum(axis=1)
    return len(np.unique(sizes)) == 1


def distances(rollout: Log) -> list[str]:
    """Return the names of the fields and barriers whose distance is in the log."""
    names = (name for name in rollout.columns if name.startswith("distance."))
    return [name.removeprefix("distance.") for name in names]


def barriers(rollout: Log) -> list[str]:
    """Return the names of user-defined barriers whose value is in the log."""
    names = (name for name in rollout.columns if name.startswith("barrier."))
    return [name.removeprefix("barrier.") for name in names]


def column_unit(rollout: Log, name: str) -> str:
    """Return the unit of a column in the log; a dash if it has none."""
    unit = str(rollout.meta.get("columns", {}).get(name, {}).get("unit", "-"))
    return "–" if unit == "-" else unit


# --- targets that are far away or out of reach ---------------------------------------

PULL_COLUMN, PULLED = "pull.force", 1.0
"""Column of the force on a pulled link, and the least that is reported [N]."""
FAR, OUT = "target far away", "target out of reach"
"""Their words in every summary."""
REACHED = 0.01
"""An error up to this length is not reported [m, rad or N]."""
RESTING = 0.1
"""An error rests if it changes by less than this share of itself in a second [1/s]."""
STAYS = 0.3
"""Duration of that: a step begins at rest, too [s]."""
LIMITED = 2  # the log's status from which on a limit changes the motion


class Unreached(NamedTuple):
    """A task and the rows in which its target is not reached."""

    task: str  # its name in the log
    # where the error is beyond the task's `largest_error` and not out of reach, shape
    # (N,)
    far: NDArray[np.bool_]
    # the remaining error where the target is out of reach, otherwise 0, shape (N,) [m
    # or rad]: of the first part of the error that is not reached
    out: Array
    unit: NDArray[np.object_]  # of each number of ``out``, shape (N,)

    def length(self, row: int) -> str:
        """Return the error that remains in a row."""
        return f"{self.out[row]:.2f} {self.unit[row]}"

    def words(self, row: int) -> str:
        """Return a row's message; empty if the hand is still moving there."""
        if self.out[row] > 0.0:
            return f"{OUT}, {self.length(row)}"
        return FAR if self.far[row] else ""


def unreached(
    columns: Mapping[str, Array],
    tasks: Mapping[str, Any],
    moved: dict[str, float] | None = None,
) -> Iterator[Unreached]:
    """Yield the tasks of a log, with the rows in which they do not reach their targets.

    A target is out of reach, of this robot within its limits, if an error remains that
    the law would remove: it rests, and the law is damped at a singularity or a limit is
    active. Errors from friction or a load, where the law is exact, are excluded, and so
    are targets that move on while the robot follows as closely as it can. ``moved``,
    when each part of an error moved last [s], is kept from these rows to the next ones.
    """
    moved = {} if moved is None else moved
    times, none = columns["t"], np.zeros(len(columns["t"]))
    held = (columns.get("damped", none) > 0.0) | (
        columns.get("status", none) >= LIMITED
    )
    # otherwise it is held away by a hand
    held &= ~(columns.get(PULL_COLUMN, none) > PULLED)
    for task, described in tasks.items():
        if f"task.{task}.error" not in columns:
            continue
        error, rate = columns[f"task.{task}.error"], columns[f"task.{task}.error_rate"]
        out, units, first = none.copy(), np.full(len(times), "", object), 0
        for part, unit, _, size in described["error"]:
            rows = slice(first, first + size)
            first += size
            length = np.linalg.norm(error[:, rows], axis=1)
            speed = np.linalg.norm(rate[:, rows], axis=1)
            rests = held & (length > REACHED) & (speed < RESTING * length)
            key = f"{task} {part}"
            last = moved.get(key, times[0])
            since = np.maximum.accumulate(np.where(rests, last, times))
            moved[key] = float(since[-1])
            here = rests & (times - since >= STAYS) & (out == 0.0)
            out[here], units[here] = length[here], unit
        # A log with few columns lacks this one.
        far = columns.get(f"task.{task}.bounded", none) > 0.0
        yield Unreached(task, far & (out == 0.0), out, units)


# --- commanded forces ----------------------------------------------------------------


class ForceKept(NamedTuple):
    """How a contact's commanded force is tracked, in the rows that command one."""

    contact: str  # its name
    wanted: Array  # the commanded normal force, without feedback, shape (n,) [N]
    planned: Array  # the planned one, likewise
    actual: Array  # the plant's force, or else the planned one, shape (n,) [N]
    lost: int  # number of rows without touch


def forces_kept(rollout: Log) -> Iterator[ForceKept]:
    """Yield how the contacts with a commanded force keep it."""
    columns = rollout.columns
    for column, about in rollout.meta["columns"].items():
        if "normal" not in about:
            continue
        prefix, normal = column.removesuffix(".commanded"), np.array(about["normal"])
        wanted = columns[column] @ normal  # NaN while the contact is not active
        rows = wanted > REACHED
        if not rows.any():
            continue
        planned = columns[f"{prefix}.force"] @ normal
        actual = columns.get(f"plant.contact.{about['frame']}.force")
        actual = planned if actual is None else actual @ normal
        added = columns.get(f"{prefix}.integral", np.zeros(len(rows)))
        wanted, planned, actual = (
            x[rows] for x in (wanted - added, planned - added, actual)
        )
        touched = actual > 0.0
        lost = int((~touched[touched.argmax() :]).sum())
        yield ForceKept(prefix.removeprefix("contact."), wanted, planned, actual, lost)


# --- the numbers that sum a run up ---------------------------------------------------


class Measure(NamedTuple):
    """A number that summarises a run.

    Attributes:
        value: The number.
        unit: Its unit; a dash if it has none.
        meaning: A short description.
    """

    value: float
    unit: str
    meaning: str


def measures(rollout: Log) -> dict[str, Measure]:
    """Return the metrics of a run, by the names of a sweep's columns.

    For a run that ended early they are computed until its end; ``simulated_time`` is
    the time until then. A task that was never active, or a missing column, gives
    NaN.
    """
    if not len(rollout):
        return {}
    found: dict[str, Measure] = {}

    def add(name: str, value: float, unit: str, meaning: str) -> None:
        found[name] = Measure(float(value), unit, meaning)

    for part in task_errors(rollout):
        name = measure_name(part)
        what, active = f"error of {part.label}", part.norm[np.isfinite(part.norm)]
        add(f"{name}.rms", _rms(active), part.unit, f"rms {what}")
        add(f"{name}.max", _largest(active), part.unit, f"largest {what}")
        last = active[-1] if len(active) else np.nan
        add(f"{name}.end", last, part.unit, f"{what} at the end")
    e_N, unit = rollout["null_space_norm"], column_unit(rollout, "null_space_norm")
    add("null_space_error.rms", _rms(e_N), unit, "rms null-space error")
    add("null_space_error.max", _largest(e_N), unit, "largest null-space error")
    add("null_space_error.end", e_N[-1], unit, "null-space error at the end")
    values = rollout["singular_values"]
    if values.size:
        # Determinants of different sizes are not comparable.
        alike = rows_compare(rollout)
        least = _smallest(rollout["manipulability"]) if alike else np.nan
        add("manipulability.min", least, "–", "minimum det(J W⁻¹ Jᵀ)")
        add("singular_value.min", _smallest(values), "–", "smallest singular value")
    damped = float(np.mean(rollout["damped"] > 0.0))
    add("damped.fraction", damped, "–", "fraction of time near a singularity")
    for field in distances(rollout):
        name, meaning = f"distance.{field}", f"minimum distance of {field}"
        add(f"{name}.min", _smallest(rollout[name]), "m", meaning)
    for own in barriers(rollout):
        name, meaning = f"barrier.{own}", f"smallest value of {own}"
        add(f"{name}.min", _smallest(rollout[name]), "–", meaning)
    tau, unit = rollout.tau, effort_unit(rollout)
    add("effort.max", _largest(np.abs(tau)), unit, "largest effort")
    rms = _rms(np.linalg.norm(tau, axis=1))
    add("effort.rms", rms, unit, "rms effort of all joints")
    speed, unit = _largest(np.abs(rollout.v)), column_unit(rollout, "v")
    add("speed.max", speed, unit, "largest joint speed")
    for name, of in ((POSITION, "position"), (VELOCITY, "speed")):
        if name in rollout.columns:
            most, unit = _largest(rollout[name]), column_unit(rollout, name)
            add(f"{name}.max", most, unit, f"farthest beyond a {of} limit")
    add("simulated_time", rollout.t[-1] - rollout.t[0], "s", "simulated time")
    return found


def measure_name(part: LoggedErrorPart) -> str:
    """Return the prefix of the names of a task's measures."""
    return f"tracking.{part.label.replace(' ', '.')}"


# A task, a contact or an obstacle may come or go during a run: then its numbers are
# those of the rows in which it was there, and NaN if there are none.


def _known(values: Array) -> Array:
    return values[~np.isnan(values)]


def _rms(values: Array) -> float:
    known = _known(values)
    return float(np.sqrt(np.mean(known**2))) if known.size else np.nan


def _smallest(values: Array) -> float:
    known = _known(values)
    return float(known.min()) if known.size else np.nan


def _largest(values: Array) -> float:
    known = _known(values)
    return float(known.max()) if known.size else np.nan
