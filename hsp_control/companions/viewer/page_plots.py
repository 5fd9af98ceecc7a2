"""The plots beside the scene: which curves of a log they show, packed for the page."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array, Indices
from hsp_control.companions.plots import log_series, palette
from hsp_control.companions.plots.analysis import expected_floor
from hsp_control.companions.viewer.commands import (
    PLOTS,
    Json,
    PageCommand,
    page_command,
)
from hsp_control.companions.viewer.comparison import ComparedRun
from hsp_control.companions.viewer.packing import CLOCK_STEP, ArrayTable, keyframe_rows
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout, measures
from hsp_control.simulation.log_writer import LogWriter, continuous_dofs
from hsp_control.simulation.rollout import complete_columns


class Series(NamedTuple):
    """One curve."""

    name: str  # its name in the legend
    values: Array  # one per row of the log, (N,)
    color: str  # its colour, ``#RRGGBB``
    dashed: bool = False
    # A prediction, not a measurement: the axis need not include it.
    predicted: bool = False
    band: bool = False  # fill the plot below it


class Edge(NamedTuple):
    """A lower bound of curves, drawn as a line: contact."""

    value: float  # the value, in the panel's unit
    name: str  # its label; "" for zero


class Panel(NamedTuple):
    """One plot over time."""

    title: str
    unit: str  # the unit of the curves
    series: Sequence[Series]
    logarithmic: bool = False  # whether its axis is logarithmic
    edges: Sequence[Edge] = ()  # values that the axis includes and draws as lines
    note: str = ""  # A remark beside the title, or ""


def panels_of(
    rollout: Rollout, controller: Controller | None = None
) -> Iterator[Panel]:
    """Yield the plots of a log, without those whose columns it lacks."""
    errors, kinds = [], list[str]()
    for part in measures.task_errors(rollout):
        name, color = f"{part.label} [{part.unit}]", palette.task(part.task)
        errors.append(Series(name, part.norm, color, part.unit == "rad"))
        kinds.append(part.unit)
    units = ", ".join(dict.fromkeys(kinds))
    if errors:
        yield Panel("Task error ‖e‖", units, errors, logarithmic=True)
    period = log_series.held_period(rollout)
    yield Panel(
        "Null-space error ‖e_N‖",
        measures.rate_unit(rollout),
        list(_null_space(rollout, controller)),
        logarithmic=True,
        note=f"effort held for {1e3 * period:g} ms" if period else "",
    )
    watched = log_series.logged_distances(rollout)
    if watched:
        values = np.column_stack([each.values for each in watched])
        curves, unit = _lines(values, [each.label for each in watched])
        edges = dict.fromkeys(
            Edge(each.edge, each.edge_name or "contact")
            for each in watched
            if each.edge is not None
        )
        yield Panel("Minimum distance", "m", curves, edges=list(edges))
    joints = log_series.joint_names(rollout)
    named = len(log_series.lively(rollout.tau))
    some = f"{named} of {len(joints)}" if named < len(joints) else ""
    positions, what = log_series.joint_positions(rollout)
    curves, unit = _lines(positions, joints, measures.position_units(rollout))
    yield Panel(what.capitalize() + "s", unit, curves, note=some)
    if measures.rows_compare(rollout):
        unit = measures.column_unit(rollout, "manipulability")
        curves = [Series("det(J W⁻¹ Jᵀ)", rollout["manipulability"], palette.TASK)]
        yield Panel("Determinant", unit, curves)
    name = str(rollout.meta.get("field", "field")).replace("_", " ")
    value = Series(name, rollout["field.value"], palette.FIELD)
    unit = measures.column_unit(rollout, "field.value")
    if np.ptp(value.values) > 0.0:
        yield Panel("Value of the field", unit, [value])
    curves, unit = _lines(rollout.tau, joints, measures.effort_units(rollout))
    yield Panel("Efforts τ", unit, curves, note=some)


def _null_space(rollout: Rollout, controller: Controller | None) -> Iterator[Series]:
    decay = log_series.predicted_decay(rollout)
    for predicted, gain in zip((decay.slow, decay.fast), decay.gains, strict=True):
        if predicted is not None:
            name = f"predicted: exp(−{gain:g} t)"
            yield Series(name, predicted, palette.INK, dashed=True, predicted=True)
            if decay.fast is decay.slow:
                break
    yield Series("‖e_N‖", rollout["null_space_norm"], palette.FIELD)
    floor = expected_floor(rollout, controller)
    if floor is not None:
        name = "held effort: expected floor"
        yield Series(name, floor, palette.MUTED, predicted=True, band=True)


def _lines(
    values: Array, names: Sequence[str], units: Sequence[str] | None = None
) -> tuple[list[Series], str]:
    """Return one curve per column (of many, those that vary most), and units."""
    chosen = log_series.lively(values)
    units = list(units or [""] * len(names))
    kinds = list(dict.fromkeys(units[column] for column in chosen))
    mixed = len(kinds) > 1
    curves = [
        Series(
            f"{names[column]} [{units[column]}]" if mixed else names[column],
            values[:, column],
            palette.series(place),
            place >= len(palette.SERIES),
        )
        for place, column in enumerate(chosen)
    ]
    return curves, ", ".join(kinds)


CURVE_BOUND = 1 / 500  # maximum error of a curve, over the height of its plot
_FLOOR, _TOP = 1e-17, 1e-6
"""Values up to the floor are rounding errors; a logarithmic axis reaches the top."""


class _CurveOfRun(NamedTuple):
    """A curve of one of the runs."""

    run: int  # the number of its run
    times: Array  # its times [s], (N,)
    series: Series


def pack_panels(runs: Sequence[ComparedRun], arrays: ArrayTable) -> Json:
    """Return plots of runs for ``plots.js``, one per title and unit."""
    panels: dict[tuple[str, str], Panel] = {}
    curves: dict[tuple[str, str], list[_CurveOfRun]] = {}
    for number, run in enumerate(runs):
        for panel in panels_of(run.rollout, run.controller):
            if not any(np.isfinite(each.values).any() for each in panel.series):
                continue  # of a law in a log of states, of a task that never begins
            key = panel.title, panel.unit
            both = dict.fromkeys((*panels.get(key, panel).edges, *panel.edges))
            panels[key] = panels.get(key, panel)._replace(edges=list(both))
            known = curves.setdefault(key, [])
            colors = {curve.series.name: curve.series.color for curve in known}
            for each in panel.series:
                alike = each._replace(color=colors.get(each.name, each.color))
                known.append(_CurveOfRun(number, run.rollout.t, alike))
    return {
        "runs": [run.name for run in runs],
        "start": min(float(run.rollout.t[0]) for run in runs),
        "end": max(float(run.rollout.t[-1]) for run in runs),
        "damped": [
            log_series.spans_of(run.rollout.t, run.rollout["damped"] > 0.0)
            for run in runs
        ],
        "panels": [_packed(panels[key], curves[key], arrays) for key in panels],
    }


def _packed(panel: Panel, curves: Sequence[_CurveOfRun], arrays: ArrayTable) -> Json:
    measured = [c.series.values for c in curves if not c.series.predicted]
    low, high = _range(panel, np.concatenate(measured))
    span = high - low
    bound = CURVE_BOUND * span
    step = bound / 8.0
    packed = []
    for run, times, series in curves:
        missing = np.isnan(series.values)
        shown = _filled(np.asarray(series.values, float), missing)
        if panel.logarithmic:
            with np.errstate(divide="ignore"):
                shown = np.log10(shown.clip(0.0))
        # All values outside the axis are clipped to one height beyond its end.
        shown = shown.clip(low - span, high + span)
        rounded = step * np.rint(shown / step)
        keys = keyframe_rows(times, shown, rounded, bound)
        numbers = {
            "times": arrays.numbers(times[keys], CLOCK_STEP, np.float64),
            "values": arrays.numbers(rounded[keys], step),
            "gaps": log_series.spans_of(times, missing),
        }
        packed.append({**series._asdict(), "run": run, **numbers})
    edges = [edge._asdict() for edge in panel.edges]
    about = {"edges": edges, "low": low, "high": high, "series": packed}
    return {**panel._asdict(), **about}


def _filled(values: Array, missing: NDArray[np.bool_]) -> Array:
    """Return values that stay where there are none: a gap costs no keyframes."""
    filled, known = values.copy(), np.flatnonzero(~missing)
    gaps = np.flatnonzero(missing)
    filled[gaps] = np.interp(gaps, known, values[known]) if known.size else 1.0
    return filled


def _range(panel: Panel, values: Array) -> tuple[float, float]:
    """Return the limits of the axis; as powers of ten if it is logarithmic."""
    shown = values[np.isfinite(values)]
    if panel.logarithmic:
        shown = shown[shown > _FLOOR]
        high = max(float(shown.max(initial=_TOP)), _TOP)
        # A norm that crosses zero has dips at single rows; the axis ignores them.
        low = float(np.quantile(shown, 0.005)) if shown.size else high
        return float(np.log10(0.4 * low)), float(np.log10(3.0 * high))
    low, high = float(shown.min(initial=np.inf)), float(shown.max(initial=-np.inf))
    if not low <= high:
        return 0.0, 1.0
    for edge in panel.edges:
        low, high = min(low, edge.value), max(high, edge.value)
    room = 0.06 * (high - low) or max(0.05 * abs(low), 0.5)
    return low - room, high + room


PREVIEW_ROWS = 500  # approximate number of plotted rows of a run that is being computed


def plots_of(runs: Sequence[ComparedRun]) -> PageCommand:
    """Return the command that shows the plots of complete runs."""
    return _command(runs, None)


def plots_so_far(
    recorder: LogWriter, meta: Json, robot: Robot, duration: float
) -> PageCommand:
    """Return the command that plots a run so far, on the whole run's axis."""
    rows = recorder.rows(0)
    chosen = _chosen(len(rows["t"]))
    columns = {name: values[chosen] for name, values in rows.items()}  # copies
    complete_columns(columns, continuous_dofs(robot))
    # Without the controller: the expected floor takes too long to compute meanwhile.
    return _command([ComparedRun("", robot, Rollout(columns, meta), None)], duration)


def _command(runs: Sequence[ComparedRun], end: float | None) -> PageCommand:
    arrays = ArrayTable()
    plots = pack_panels(runs, arrays)
    if end is not None:
        plots["end"] = max(end, plots["end"])
    return page_command("plots", PLOTS, "plots", plots=plots, arrays=arrays.entries)


def _chosen(count: int) -> Indices:
    """Return rows at distances of a power of two, so that curves don't flicker."""
    step = 1
    while count > step * PREVIEW_ROWS:
        step *= 2
    return np.append(np.arange(0, count - 1, step), count - 1)
