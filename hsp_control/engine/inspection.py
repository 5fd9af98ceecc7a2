"""What a plan does: its calls, what writes their arguments, which one went wrong."""

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
    """Return what a plan does, a line for each call and for each of its arguments.

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
    """Make a plan call by call, up to the first one that writes NaN.

    Args:
        step: The plan.
        t: The time that its calls are given [s].

    Returns:
        That call, and the names of the arguments that it wrote so; None if there is
        none. A call within `Once` is made whether it was made at this stamp or not.
        Infinite is what has no limit.
    """
    for call in calls(step):
        if isinstance(call, Call) and any(
            isinstance(x, Plan | Move) for x in call.values.values()
        ):
            continue  # what it makes was made
        if isinstance(call, Runnable):
            call(t)
        if isinstance(call, Call):
            wrong = [
                name for name in call.kind.writes if np.isnan(call.values[name]).any()
            ]
            if wrong:
                return call, wrong
    return None
