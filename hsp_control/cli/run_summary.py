"""What a run did: its tasks, what limits did to it, its speed, the size of its log."""

from collections.abc import Iterator
from time import perf_counter

import numpy as np
from rich.table import Table

from hsp_control.control.compensation.momentum_observer import LARGE_SHARE
from hsp_control.simulation import Rollout
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.measures import (
    FAR,
    OUT,
    effort_units,
    forces_kept,
    rate_unit,
    rows_compare,
    task_errors,
    unreached,
)

LOST, STILL = 0.5, 0.05
"""Share of a field, and a speed [rad/s or m/s], from which on limits keep it off."""
GIVEN_UP = 0.01
"""Share of a commanded force from which on its plan does not keep it."""


def summary(rollout: Rollout) -> Table:
    """Return what a run did, as a table."""
    table = Table(show_header=False, box=None, pad_edge=False)
    table.add_row(
        "run", f"{len(rollout)} rows to t = {rollout.t[-1]:g} s, {rollout.status}"
    )
    if observed := rollout.meta.get("momentum_observer"):
        table.add_row("momentum observer", observed)
        for row in unexplained_rows(rollout):
            table.add_row("", row)
    tasks = rollout.meta["tasks"]
    away = {each.task: each for each in unreached(rollout.columns, tasks)}
    for k, task in enumerate(tasks):
        for part in (each for each in task_errors(rollout) if each.task == k):
            tracked = part.norm[np.isfinite(part.norm)]  # it may be off for a while
            if not len(tracked):
                table.add_row(f"task {part.label}", "was never active")
                continue
            rms, last, unit = np.sqrt(np.mean(tracked**2)), tracked[-1], part.unit
            table.add_row(
                f"task {part.label}",
                f"|e| rms {rms:.3g} {unit}, at the end {last:.3g} {unit}",
            )
        for words, rows in ((FAR, away[task].far), (OUT, away[task].out > 0.0)):
            if count := int(rows.sum()):
                text = f"{count} rows: {words}"
                if words == OUT and rows[-1]:
                    text += f", {away[task].length(-1)} at the end"
                table.add_row("", text)
    for contact, text in force_rows(rollout):
        table.add_row(contact, text)
    norm, unit = rollout["null_space_norm"], rate_unit(rollout)
    table.add_row(
        "null space",
        f"|e_N| {norm[0]:.3g} {unit} at the start, {norm[-1]:.3g} {unit} at the end",
    )
    if beyond := beyond_limits(rollout):
        table.add_row("", beyond)
    values = rollout["singular_values"]
    smallest = f"smallest singular value {np.nanmin(values, initial=np.inf):.3g}"
    if values.size and rows_compare(rollout):
        least = f"minimum {np.nanmin(rollout['manipulability']):.4g}, {smallest}"
        table.add_row("det(J W⁻¹ Jᵀ)", least)
    elif values.size:  # determinants of different sizes do not compare
        table.add_row("J L⁻ᵀ", smallest)
    largest = np.abs(rollout.tau).max(axis=0)
    unit = effort_units(rollout)[largest.argmax()]
    table.add_row("effort", f"largest {largest.max():.3g} {unit}")
    for row in limit_rows(rollout):
        table.add_row("limits", row)
    if damped := int((rollout["damped"] > 0.0).sum()):
        table.add_row("singular", f"{damped} rows: the law was damped there, not exact")
    return table


def beyond_limits(rollout: Rollout) -> str:
    """Return that a field asks for more than limits give, if it does at the end."""
    last = slice(-max(len(rollout) // 10, 1), None)
    asked = np.linalg.norm(rollout["field.g"][-1])
    missing = rollout["null_space_norm"][-1]
    held = np.isin(rollout["status"][last], (2, 4)).all()
    if not held or missing < LOST * asked or missing < STILL:
        return ""
    unit = rate_unit(rollout)
    return (
        f"the field asks for more than the limits give: |g| {asked:.3g} {unit}, "
        f"|e_N| {missing:.3g} {unit} at the end"
    )


def force_rows(rollout: Rollout) -> Iterator[tuple[str, str]]:
    """Yield what became of commanded forces, as rows of the table."""
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


def unexplained_rows(rollout: Rollout) -> Iterator[str]:
    """Yield what an observer found that the model does not explain, one sentence."""
    found = rollout.columns.get("observer.disturbance")
    if found is None:
        return
    size = np.abs(found).max(axis=0)
    dof = int(size.argmax())
    unit = effort_units(rollout)[dof]
    text = f"up to {size[dof]:.3g} {unit} that the model does not explain, on "
    yield text + rollout.meta["robot"]["dofs"][dof]
    limits = np.array(rollout.meta["limits"].get("effort", []), dtype=float)
    if len(limits) == len(size):  # NaN: there is none
        share = size / np.where(limits > 0.0, limits, np.inf)
        dof = int(share.argmax())
        if share[dof] > LARGE_SHARE:
            yield (
                "the robot does not do what the model says: that is "
                f"{100.0 * share[dof]:.0f} % of the effort limit of "
                f"{rollout.meta['robot']['dofs'][dof]}; is there a load, or a contact?"
            )
            if not rollout.meta["robot"].get("rotors", True):
                yield "the model has no rotors: robot: motor_inertia adds them"


def limit_rows(rollout: Rollout) -> Iterator[str]:
    """Yield one sentence each; none where no limit was active and no joint beyond."""
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


def excess_rows(rollout: Rollout) -> Iterator[str]:
    """Yield where the robot was beyond its limits, a sentence each."""
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


class Stopwatch:
    """Measures the wall time from the first row on."""

    def __init__(self) -> None:
        self._first: float | None = None
        self._last = 0.0

    def lap(self) -> None:
        """Record the time of a row."""
        self._last = perf_counter()
        if self._first is None:
            self._first = self._last

    def table_rows(self, rollout: Rollout) -> list[tuple[str, str]]:
        """Return speed and size as rows of a table: name and text."""
        rows = len(rollout)
        size = sum(column.nbytes for column in rollout.columns.values())
        found = [
            ("log", f"{size / rows:.0f} bytes per row, {size / 1e6:.2g} MB in memory")
        ]
        took = 0.0 if self._first is None else self._last - self._first
        if rows > 1 and took > 0.0:
            simulated = float(rollout.t[-1] - rollout.t[0])
            found.insert(
                0,
                (
                    "speed",
                    f"{simulated / took:.3g} times real time ({simulated:g} s in "
                    f"{took:.2g} s, logging included)",
                ),
            )
        return found
