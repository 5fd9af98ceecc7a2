"""Inspection of a plan: its calls, the writers of their arguments, the first NaN."""

from collections.abc import Iterator
from typing import Any

import numpy as np

from hsp_control.engine._engine import Call, Move, Plan, Runnable


def calls(step: object) -> Iterator[Any]:
    """Yield the calls of a plan in order, also of those within others."""
    if isinstance(step, Plan):
        for each in step.calls:
            yield from calls(each)
        return
    inner = step.values if isinstance(step, Call | Move) else {}
    for each in inner.values():
        if isinstance(each, Plan | Move):
            yield from calls(each)
    if not isinstance(step, Move):
        yield step


def listing(step: object) -> str:
    """Return the contents of a plan, a line per call and each of its arguments.

    An array that an earlier call of the plan writes is shown with that call's number.
    """
    lines: list[str] = []
    writers: dict[int, int] = {}
    for number, call in enumerate(calls(step)):
        if not isinstance(call, Call):
            lines.append(f"{number:3d} {call!r}")
            continue
        lines.append(f"{number:3d} {call.kind.name}")
        written = set(call.kind.writes)
        for name, value in call.values.items():
            if not isinstance(value, np.ndarray):
                lines.append(f"      {name} = {value!r}")
                continue
            sizes = " x ".join(map(str, value.shape))
            writer = writers.get(value.ctypes.data)
            source = "" if writer is None else f", from {writer}"
            arrow = "->" if name in written else "<-"
            lines.append(f"      {arrow} {name} [{sizes}]{source}")
        for name in written:
            writers[call.values[name].ctypes.data] = number
    return "\n".join(lines)


def first_nan(step: object, t: float = 0.0) -> tuple[Any, list[str]] | None:
    """Run a plan call by call, up to the first one that writes NaN.

    Args:
        step: The plan.
        t: The time passed to its calls [s].

    Returns:
        That call, and the names of its arguments with NaN; None if there is none. A
        call within `Once` runs even if it did at this stamp. Infinity is valid: no
        limit.
    """
    for call in calls(step):
        if isinstance(call, Call) and any(
            isinstance(x, Plan | Move) for x in call.values.values()
        ):
            continue  # its calls have run
        if isinstance(call, Runnable):
            call(t)
        if isinstance(call, Call):
            wrong = [
                name for name in call.kind.writes if np.isnan(call.values[name]).any()
            ]
            if wrong:
                return call, wrong
    return None
