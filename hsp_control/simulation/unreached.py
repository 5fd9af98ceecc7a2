"""Which targets are far away or out of reach, as the rows of a log tell."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array

FAR, OUT = "target far away", "target out of reach"
"""What is said of them, whoever says it."""
REACHED = 0.01
"""An error up to this length is not spoken of [m or rad]."""
RESTING = 0.1
"""An error rests if it changes by less than this share of itself in a second [1/s]."""
STAYS = 0.3
"""Time that it has to rest: a step begins at rest, too [s]."""
_LIMITED = 2  # the log's status from which on a limit changes the motion


class Unreached(NamedTuple):
    """A task and the rows in which its target is not reached."""

    task: str  # its name in the log
    # where the error is beyond the task's `largest_error` and not out of reach, shape
    # (N,)
    far: NDArray[np.bool_]
    # the error that stays where the target is out of reach, else 0, shape (N,) [m or
    # rad]: the first part of the error that is not reached
    out: Array
    unit: NDArray[np.object_]  # of each number of ``out``, shape (N,)

    def length(self, row: int) -> str:
        """Return the error that stays in a row."""
        return f"{self.out[row]:.2f} {self.unit[row]}"

    def words(self, row: int) -> str:
        """Return what there is to say of a row; nothing if it is on the way there."""
        if self.out[row] > 0.0:
            return f"{OUT}, {self.length(row)}"
        return FAR if self.far[row] else ""


def unreached(
    columns: Mapping[str, Array],
    tasks: Mapping[str, Any],
    moved: dict[str, float] | None = None,
) -> Iterator[Unreached]:
    """Yield the tasks of a log, with the rows in which they do not reach their targets.

    A target is out of reach, of this robot within its limits, if an error stays that
    the law would remove: it rests, and the law is damped at a singularity or a limit
    binds. What friction or a load leaves, where the law is exact, is not meant; nor is
    a target that moves on while the robot follows as near as it can. ``moved``, when
    each part of an error moved last [s], is kept from these rows to the next ones.
    """
    moved = {} if moved is None else moved
    times, none = columns["t"], np.zeros(len(columns["t"]))
    held = (columns.get("damped", none) > 0.0) | (
        columns.get("status", none) >= _LIMITED
    )
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
        # A log that says little has no such column.
        far = columns.get(f"task.{task}.bounded", none) > 0.0
        yield Unreached(task, far & (out == 0.0), out, units)
