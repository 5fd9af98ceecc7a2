"""The plots beside a running loop: their curves, limits and notes."""

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.companions.plots.log_series import (
    joint_names,
    logged_distances,
)
from hsp_control.companions.plots.palette import SERIES
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import PULL_COLUMN, effort_units, rate_unit

_JOINTS = 8  # maximum number of joints with separate curves


class Curve(NamedTuple):
    """One curve of a plot."""

    name: str
    column: str  # column of the log
    rows: slice = slice(0, 1)  # which components, of which the norm is shown
    # Limits of these components, shape (n,): the largest share of them is shown [%].
    over: Array | None = None

    def values(self, rows: Mapping[str, Array]) -> Array:
        """Return its values in rows of a log, shape (N,); NaN where there is none."""
        column = rows.get(self.column)
        if column is None:
            return np.full(len(rows["t"]), np.nan)
        if column.ndim == 1:
            return column
        part = column[:, self.rows]
        if self.over is not None:
            return np.asarray(100.0 * np.max(np.abs(part) / self.over, axis=1))
        return part[:, 0] if part.shape[1] == 1 else np.linalg.norm(part, axis=1)


class Line(NamedTuple):
    """A value that curves should not cross: a limit, or contact."""

    value: float  # in the plot's unit
    name: str  # its label; "": none
    curves: tuple[int, ...]  # indices of the curves that it limits


class LivePlot(NamedTuple):
    """One plot."""

    title: str
    note: str  # description of the curves
    unit: str
    log: bool  # whether its scale is logarithmic
    curves: list[Curve]
    lines: Sequence[Line] = ()
    # Whether the axis always reaches the lines; else where a curve is near one, and for
    # a curve that is shown alone.
    reaches: bool = False

    def describe(self) -> dict[str, Any]:
        """Return its description for the page."""
        colors = [SERIES[place % len(SERIES)] for place in range(len(self.curves))]
        return {
            "title": self.title,
            "note": self.note,
            "unit": self.unit,
            "log": self.log,
            "series": [
                {"name": curve.name, "color": color}
                for curve, color in zip(self.curves, colors, strict=True)
            ],
            "lines": [line._asdict() for line in self.lines],
            "reaches": self.reaches,
        }


def live_plots(rows: Mapping[str, Array], meta: Mapping[str, Any]) -> list[LivePlot]:
    """Return the plots of a log that is being written, the most informative first."""
    log = Rollout(dict(rows), dict(meta))
    return [
        *_null_space(log),
        *_clearance(log),
        _joints(log, "Efforts τ", "tau", effort_units(log), "effort"),
        _joints(log, "Speeds v", "v", _rates(log), "velocity"),
        *_forces(log),
        *_errors(log),
    ]


def _null_space(log: Rollout) -> Iterator[LivePlot]:
    if not log.meta["controls_null_space"]:
        return
    note = "Projected field minus joint velocity; decays at K_N unless damped."
    norm = Curve("‖e_N‖", "null_space_norm")
    yield LivePlot("Null-space error ‖e_N‖", note, rate_unit(log), True, [norm])


def _clearance(log: Rollout) -> Iterator[LivePlot]:
    found = logged_distances(log)
    if not found:
        return
    names = [name for name in log.columns if name.startswith("distance.")]
    curves = [Curve(each.label, name) for each, name in zip(found, names, strict=True)]
    lines: dict[tuple[float, str], list[int]] = {}
    for place, each in enumerate(found):
        if each.edge is not None:
            lines.setdefault((each.edge, each.edge_name or "contact"), []).append(place)
    drawn = [Line(*about, tuple(places)) for about, places in lines.items()]
    note = "Smallest distance to obstacles and between links."
    yield LivePlot("Clearance", note, "m", False, curves, drawn, reaches=True)


def _rates(log: Rollout) -> list[str]:
    return [f"{unit}/s" for unit in log.meta["robot"]["units"]]


def _joints(
    log: Rollout, title: str, column: str, units: Sequence[str], kind: str
) -> LivePlot:
    """Return one plot per joint; for many joints one of the largest share."""
    names = joint_names(log)
    given = log.meta["limits"].get(kind) or [None] * len(names)
    limits = np.array(given, dtype=float)  # NaN where there is none
    known = np.isfinite(limits) & (limits > 0.0)
    unit = ", ".join(dict.fromkeys(units))
    what = "Joint efforts" if column == "tau" else "Joint speeds"
    if len(names) > _JOINTS:
        if not known.any():
            norm = [Curve(f"‖{title[-1]}‖", column, slice(0, len(names)))]
            return LivePlot(title, f"{what}, their norm.", unit, False, norm)
        over = np.where(known, limits, np.inf)
        share = [Curve("largest", column, slice(0, len(names)), over)]
        note = f"{what}: the largest relative to its limit."
        full = [Line(100.0, "limit", (0,))]
        return LivePlot(title, note, "%", False, share, full, reaches=True)
    curves = [Curve(name, column, slice(k, k + 1)) for k, name in enumerate(names)]
    places: dict[float, list[int]] = {}
    for place in np.flatnonzero(known):
        places.setdefault(float(limits[place]), []).append(int(place))
    lines = []
    for limit, own in places.items():
        whose = "" if len(places) == 1 else f" of {_span([names[k] for k in own])}"
        lines.append(Line(limit, f"limit{whose}", tuple(own)))
        lines.append(Line(-limit, f"limit{whose}", tuple(own)))
    values = ", ".join(f"±{limit:.4g}" for limit in sorted(places))
    note = f"{what}; limits {values}." if places else f"{what}."
    return LivePlot(title, note, unit, False, curves, lines)


def _span(names: Sequence[str]) -> str:
    return names[0] if len(names) == 1 else f"{names[0]} … {names[-1]}"


def _forces(log: Rollout) -> Iterator[LivePlot]:
    contacts = re.compile(r"contact\.(.+)\.force")
    found = filter(None, map(contacts.fullmatch, log.columns))
    curves = [Curve(f"contact {each[1]}", each[0], slice(0, 3)) for each in found]
    if PULL_COLUMN in log.columns:
        curves.append(Curve("your pull", PULL_COLUMN))
    if curves:
        yield LivePlot(
            "Forces", "External forces, their magnitude.", "N", False, curves
        )


def _errors(log: Rollout) -> Iterator[LivePlot]:
    errors: dict[str, list[Curve]] = {}
    for task, about in log.meta["tasks"].items():
        first = 0
        for part, unit, _, size in about["error"]:
            name = task if len(about["error"]) == 1 else f"{task}, {part}"
            curve = Curve(name, f"task.{task}.error", slice(first, first + size))
            errors.setdefault(unit, []).append(curve)
            first += size
    for unit, curves in errors.items():
        yield LivePlot("Task error", "Distance from each target.", unit, True, curves)
