"""Packs the plots of one run or several: curves reduced to few points."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.packed.keyframes import (
    distance_error,
    keyframe_rows,
    linear,
)
from hsp_control.visualization.viewer.packed.packing import CLOCK_STEP, ArrayTable
from hsp_control.visualization.viewer.packed.panels import Panel, Series, panels_of

CURVE_BOUND = 1 / 500  # maximum error of a curve, over the height of its plot
_FLOOR, _TOP = 1e-17, 1e-6
"""Values up to the floor are rounding errors; a logarithmic axis reaches the top."""


class PlottedRun(NamedTuple):
    """A run whose curves are plotted."""

    name: str  # its name in the page's switch
    rollout: Rollout
    controller: Controller | None = None  # its controller: see `panels_of`


class _Curve(NamedTuple):
    """A curve of one of the runs."""

    run: int  # the number of its run
    times: Array  # its times [s], (N,)
    series: Series


def pack_panels(runs: Sequence[PlottedRun], arrays: ArrayTable) -> Json:
    """Return plots of runs for ``plots.js``, one for each title and unit."""
    panels: dict[tuple[str, str], Panel] = {}
    curves: dict[tuple[str, str], list[_Curve]] = {}
    for number, run in enumerate(runs):
        for panel in panels_of(run.rollout, run.controller):
            key = panel.title, panel.unit
            both = dict.fromkeys((*panels.get(key, panel).edges, *panel.edges))
            panels[key] = panels.get(key, panel)._replace(edges=list(both))
            known = curves.setdefault(key, [])
            colors = {curve.series.name: curve.series.color for curve in known}
            known += [
                _Curve(
                    number,
                    run.rollout.t,
                    each._replace(color=colors.get(each.name, each.color)),
                )
                for each in panel.series
            ]
    return {
        "runs": [run.name for run in runs],
        "start": min(float(run.rollout.t[0]) for run in runs),
        "end": max(float(run.rollout.t[-1]) for run in runs),
        "damped": [_damped(run.rollout) for run in runs],
        "panels": [_packed(panels[key], curves[key], arrays) for key in panels],
        "colors": {
            "ink": palette.INK,
            "muted": palette.MUTED,
            "grid": palette.GRID,
            "contact": palette.OBSTACLE,
            "warning": palette.WARNING,
        },
    }


def _damped(rollout: Rollout) -> list[list[float]]:
    """Return the first and the last time of every damped part of a run [s]."""
    damped = np.concatenate([[False], rollout["damped"] > 0.0, [False]])
    edges = np.flatnonzero(np.diff(damped)).reshape(-1, 2)
    times = rollout.t
    return [[float(times[first]), float(times[stop - 1])] for first, stop in edges]


def _packed(panel: Panel, curves: Sequence[_Curve], arrays: ArrayTable) -> Json:
    measured = [c.series.values for c in curves if not c.series.predicted]
    low, high = _range(panel, np.concatenate(measured))
    span = high - low
    bound = CURVE_BOUND * span
    step = bound / 8.0
    packed = []
    for run, times, series in curves:
        shown = np.asarray(series.values, float)
        if panel.logarithmic:
            with np.errstate(divide="ignore", invalid="ignore"):
                shown = np.log10(shown)
        # All values outside the axis are clipped to one height beyond its end.
        shown = np.nan_to_num(shown, nan=low - span).clip(low - span, high + span)
        shown = shown[:, None]
        rounded = step * np.rint(shown / step)
        keys = keyframe_rows(times, shown, rounded, linear, distance_error(bound))
        packed.append(
            {
                "name": series.name,
                "run": run,
                "color": series.color,
                "dashed": series.dashed,
                "band": series.band,
                "predicted": series.predicted,
                "times": arrays.numbers(times[keys], CLOCK_STEP, np.float64),
                "values": arrays.numbers(rounded[keys], step),
            }
        )
    return {
        "title": panel.title,
        "unit": panel.unit,
        "note": panel.note,
        "logarithmic": panel.logarithmic,
        "edges": [edge._asdict() for edge in panel.edges],
        "low": low,
        "high": high,
        "series": packed,
    }


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
