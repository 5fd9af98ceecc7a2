"""The summary of a run in words: its tasks, active limits, damped steps."""

from collections.abc import Iterator, Mapping

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.compensation.momentum_observer import LARGE_SHARE
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log import Log
from hsp_control.simulation.measures import (
    FAR,
    OUT,
    Measure,
    barriers,
    distances,
    effort_units,
    forces_kept,
    has_law,
    measure_name,
    measures,
    rate_unit,
    task_errors,
    unreached,
)

STILL = 0.05
"""Speed of a field above which limits prevent it [rad/s or m/s]."""
FAST = 0.1
"""Share of a speed limit beyond it that shows that the model is wrong."""
GIVEN_UP = 0.01
"""Share of a commanded force above which its plan misses it."""


def summary_rows(rollout: Log) -> Iterator[tuple[str, str]]:
    """Yield the summary of a run, as rows of a table: a name and a text.

    An empty name continues the row before.
    """
    if not len(rollout):
        yield "run", f"no rows, {rollout.status}"
        return
    found, run = measures(rollout), rollout.before_stop()
    followed = measures(run)
    yield "run", f"{len(rollout)} rows to t = {rollout.t[-1]:g} s, {rollout.status}"
    if stopping := len(rollout) - len(run):
        yield "", f"the safe stop is the last {stopping} of them, and follows no task"
    if observed := rollout.meta.get("momentum_observer"):
        yield "momentum observer", observed
        for row in unexplained_rows(rollout):
            yield "", row
    if has_law(run):
        yield from _law_rows(run, followed)
    else:  # the log of a robot
        yield "tasks", "not in this log, which has states only"
    for name in distances(rollout):
        text = f"minimum {found[f'distance.{name}.min'].value:.3g} m"
        least = rollout.meta["columns"][f"distance.{name}"].get("minimum")
        kept = "" if least is None else f", to be at least {least:g} m"
        words = name.replace("_", " ")
        words = words if words.endswith("distance") else f"distance {words}"
        yield words, text + kept
    for name in barriers(rollout):
        least = rollout.meta["columns"][f"barrier.{name}"].get("minimum")
        text = f"minimum {found[f'barrier.{name}.min'].value:.3g}"
        kept = "" if least is None else f", to be at least {least:g}"
        yield f"barrier {name}", text + kept
    largest = found["effort.max"].value
    dof = np.nanargmax(np.nanmax(np.abs(rollout.tau), axis=0))
    yield "effort", f"largest {largest:.3g} {effort_units(rollout)[dof]}"
    for text in limit_rows(rollout):
        yield "limits", text
    if damped := damped_rows(rollout):
        yield "singular", f"{damped} rows: the law was damped there, not exact"


def _law_rows(run: Log, found: Mapping[str, Measure]) -> Iterator[tuple[str, str]]:
    """Yield the rows of tasks, forces, null space and singular values."""
    yield from _task_rows(run, found)
    yield from force_rows(run)
    first, last = run["null_space_norm"][0], found["null_space_error.end"]
    yield (
        "null space",
        f"|e_N| {first:.3g} {last.unit} at the start, {_text(last)} at the end",
    )
    if beyond := beyond_limits(run):
        yield "", beyond
    if "singular_value.min" in found:
        smallest = f"smallest singular value {found['singular_value.min'].value:.3g}"
        least = found["manipulability.min"].value
        if np.isfinite(least):
            yield "det(J W⁻¹ Jᵀ)", f"minimum {least:.4g}, {smallest}"
        else:  # determinants of different sizes are not comparable
            yield "J L⁻ᵀ", smallest


def damped_rows(rollout: Log) -> int:
    """Return the number of rows in which the law was damped at a singularity."""
    known = rollout.columns.get("damped")
    return 0 if known is None else int((known > 0.0).sum())


def damped_words(rollout: Log) -> str:
    """Return the warning of a run that was damped most of the time; else nothing."""
    rows = damped_rows(rollout)
    if 2 * rows <= len(rollout):
        return ""
    text = f"the law was damped in {rows} of {len(rollout)} rows, and not exact there"
    for each in unreached(rollout.columns, rollout.meta["tasks"]):
        if words := each.words(-1):
            text += f"; task {each.task!r}: {words}"
    return text


def summary_text(rollout: Log) -> str:
    """Return the table of `summary_rows` as lines of text."""
    rows = [*summary_rows(rollout)]
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:{width}}  {text}" for name, text in rows)


def _task_rows(rollout: Log, found: Mapping[str, Measure]) -> Iterator[tuple[str, str]]:
    """Yield the tasks' errors, and the rows in which their targets were not reached."""
    tasks = rollout.meta["tasks"]
    away = {each.task: each for each in unreached(rollout.columns, tasks)}
    for k, task in enumerate(tasks):
        for part in (each for each in task_errors(rollout) if each.task == k):
            rms, last = (found[f"{measure_name(part)}.{of}"] for of in ("rms", "end"))
            text = f"|e| rms {_text(rms)}, at the end {_text(last)}"
            active = np.isfinite(part.norm).any()
            yield f"task {part.label}", text if active else "was never active"
        for words, rows in ((FAR, away[task].far), (OUT, away[task].out > 0.0)):
            if count := int(rows.sum()):
                text = f"{count} rows: {words}"
                if words == OUT and rows[-1]:
                    text += f", {away[task].length(-1)} at the end"
                yield "", text


def _text(measure: Measure) -> str:
    return f"{measure.value:.3g} {measure.unit}"


def beyond_limits(rollout: Log) -> str:
    """Return a warning if a field demands more than limits permit at the end.

    Of |P g| <= |e_N| + |v| more is missing then than is followed.
    """
    last = slice(-max(len(rollout) // 10, 1), None)
    asked = np.linalg.norm(rollout["field.g"][-1])
    missing = rollout["null_space_norm"][-1]
    followed = np.linalg.norm(rollout.v[-1])
    held = np.isin(rollout["status"][last], (2, 4)).all() and asked >= STILL
    if not (held and missing >= followed and missing >= STILL):  # or NaN
        return ""
    unit = rate_unit(rollout)
    return (
        f"the field demands more than the limits allow: |g| {asked:.3g} {unit}, "
        f"|e_N| {missing:.3g} {unit} at the end"
    )


def force_rows(rollout: Log) -> Iterator[tuple[str, str]]:
    """Yield the tracking of commanded forces, as rows of the table."""
    for contact, wanted, planned, actual, lost in forces_kept(rollout):
        missed = np.sqrt(np.mean((actual - wanted) ** 2))
        text = f"{actual[-1]:.3g} of {wanted[-1]:.3g} N at the end, "
        yield f"force {contact}", f"{text}missed by {missed:.3g} N rms"
        off = np.abs(wanted - planned)
        if rows := int((off > GIVEN_UP * (1.0 + wanted)).sum()):
            why = f"planned up to {off.max():.3g} N off, for a limit or the balance"
            yield "", f"{rows} rows: {why}"
        if lost:
            yield "", f"{lost} rows: contact lost"


def unexplained_rows(rollout: Log) -> Iterator[str]:
    """Yield the effort that an observer finds beside the model, in one sentence."""
    found = rollout.columns.get("observer.disturbance")
    if found is None:
        return
    found = found[np.isfinite(found).all(axis=1)]  # a safe stop's rows have none
    if not len(found):
        return
    size = np.abs(found).max(axis=0)
    dof = int(size.argmax())
    unit = effort_units(rollout)[dof]
    text = f"up to {size[dof]:.3g} {unit} that the model does not explain, on "
    yield text + rollout.meta["robot"]["dofs"][dof]
    share = _share_of_limit(rollout, "effort", size)
    speeds = rollout.columns.get(VELOCITY, np.zeros((1, len(size))))
    fast = _share_of_limit(rollout, "velocity", np.nanmax(speeds, axis=0))
    dof, fastest = int(share.argmax()), int(fast.argmax())
    names = rollout.meta["robot"]["dofs"]
    if share[dof] > LARGE_SHARE:
        yield (
            "the model does not describe the robot: that is "
            f"{100.0 * share[dof]:.0f} % of the effort limit of {names[dof]}; is there "
            "a load, or a contact?"
        )
    elif fast[fastest] > FAST:
        yield (
            f"the model does not describe the robot: {names[fastest]} is beyond a "
            "speed limit that it would keep; is there a load, or a contact?"
        )
    else:
        return
    if not rollout.meta["robot"].get("rotors", True):
        yield "the model has no rotors: robot: motor_inertia adds them"


def _share_of_limit(rollout: Log, kind: str, size: Array) -> Array:
    """Return sizes over limits by joint, shape (nv,); zero where there is none."""
    limits = np.array(rollout.meta["limits"].get(kind, []), dtype=float)
    if len(limits) != len(size):
        return np.zeros(len(size))
    return np.asarray(size / np.where(limits > 0.0, limits, np.inf))  # NaN: none


def limit_rows(rollout: Log) -> Iterator[str]:
    """Yield one sentence per kind; none if no limit was active and no joint beyond."""
    if POSITION not in rollout.columns:
        return
    status = rollout["status"]
    limited, relaxed, beyond = (int((status == s).sum()) for s in (2, 3, 4))
    if limited or relaxed or beyond:
        yield (
            f"{limited} rows limited of {len(rollout)}"
            + (
                f", {relaxed} relaxed by up to {np.nanmax(rollout['relaxation']):.3g}"
                if relaxed
                else ""
            )
            + (f", {beyond} beyond a limit" if beyond else "")
        )
    yield from excess_rows(rollout)


def excess_rows(rollout: Log) -> Iterator[str]:
    """Yield a sentence per kind of limit that was exceeded."""
    if POSITION not in rollout.columns:
        return
    names = rollout.meta["robot"]["dofs"]
    for column, of, per in ((POSITION, "position", ""), (VELOCITY, "speed", "/s")):
        excess = rollout[column]
        if rows := int((excess > 0.0).any(axis=1).sum()):
            row, dof = np.unravel_index(np.nanargmax(excess), excess.shape)
            unit = rollout.meta["robot"]["units"][dof] + per
            yield (
                f"{names[dof]} is {excess[row, dof]:.3g} {unit} beyond its {of} limit "
                f"at {rollout.t[row]:g} s ({rows} rows): more than the model expected"
            )
