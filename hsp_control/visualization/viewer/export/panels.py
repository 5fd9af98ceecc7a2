"""The plots beside the scene: curves of a log, reduced to few points."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout, log_series
from hsp_control.simulation.decay import predicted_decay
from hsp_control.visualization import palette
from hsp_control.visualization.viewer.commands import Json
from hsp_control.visualization.viewer.export.clip_reduction import CLOCK_STEP
from hsp_control.visualization.viewer.export.keyframes import (
    distance_error,
    keyframe_rows,
    linear,
)
from hsp_control.visualization.viewer.export.packing import ArrayTable

CURVE_BOUND = 1 / 500
"""Maximum error of a curve, over the height of its plot."""
_FLOOR, _TOP = 1e-17, 1e-6
"""Values up to the floor are rounding errors; a logarithmic axis reaches the top."""
_MAX_CURVES, _SELECTED = 14, 7
"""Of more than 14 curves, only the 7 that vary most are shown."""


class Series(NamedTuple):
    """One curve.

    Attributes:
        name: Its name in the legend.
        values: One per row of the log, shape (N,).
        color: Its colour, ``#RRGGBB``.
        dashed: Draw it dashed.
        predicted: It is a prediction, not measured: the axis need not reach it.
    """

    name: str
    values: Array
    color: str
    dashed: bool = False
    predicted: bool = False


class Panel(NamedTuple):
    """One plot over time.

    Attributes:
        title: Its title.
        unit: The unit of the curves.
        series: The curves.
        logarithmic: Whether its axis is logarithmic.
        zero: Whether the axis includes zero, drawn as a line that means contact.
    """

    title: str
    unit: str
    series: Sequence[Series]
    logarithmic: bool = False
    zero: bool = False


def panels_of(rollout: Rollout) -> list[Panel]:
    """Return the plots of a log, without those whose columns it lacks."""
    return list(_panels(rollout))


def pack_panels(rollout: Rollout, arrays: ArrayTable) -> Json:
    """Return the plots of a log in the page's format: see ``plots.js``.

    Args:
        rollout: The log.
        arrays: The table that stores the numbers.
    """
    damped = np.concatenate([[False], rollout["damped"] > 0.0, [False]])
    edges = np.flatnonzero(np.diff(damped)).reshape(-1, 2)
    return {
        "start": float(rollout.t[0]),
        "end": float(rollout.t[-1]),
        "damped": [
            [float(rollout.t[first]), float(rollout.t[stop - 1])]
            for first, stop in edges
        ],
        "panels": [_packed(panel, rollout.t, arrays) for panel in panels_of(rollout)],
        "colors": {
            "ink": palette.INK,
            "muted": palette.MUTED,
            "grid": palette.GRID,
            "contact": palette.OBSTACLE,
            "warning": palette.WARNING,
        },
    }


def _panels(rollout: Rollout) -> Iterator[Panel]:
    errors = [
        Series(
            f"{part.label} [{part.unit}]",
            part.norm,
            palette.task(part.task),
            part.unit == "rad",
        )
        for part in log_series.task_errors(rollout)
    ]
    units = ", ".join(dict.fromkeys(p.unit for p in log_series.task_errors(rollout)))
    if errors:
        yield Panel("Task error ‖e‖", units, errors, logarithmic=True)
    yield Panel(
        "Null-space error ‖e_N‖",
        log_series.column_unit(rollout, "null_space_norm"),
        list(_null_space(rollout)),
        logarithmic=True,
    )
    watched = log_series.distances(rollout)
    if watched:
        values = np.column_stack([rollout[f"distance.{name}"] for name in watched])
        names = [name.replace("_", " ") for name in watched]
        yield Panel("Minimum distance", "m", _lines(values, names), zero=True)
    positions, what = log_series.joint_positions(rollout)
    yield Panel(
        what.capitalize() + "s",
        log_series.position_unit(rollout),
        _lines(positions, log_series.joint_names(rollout)),
    )
    manipulability = Series("det(J W⁻¹ Jᵀ)", rollout["manipulability"], palette.TASK)
    yield Panel(
        "Manipulability",
        log_series.column_unit(rollout, "manipulability"),
        [manipulability],
    )
    name = str(rollout.meta.get("field", "field")).replace("_", " ")
    value = Series(name, rollout["field.value"], palette.FIELD)
    unit = log_series.column_unit(rollout, "field.value")
    if np.ptp(value.values) > 0.0:
        yield Panel("Value of the field", unit, [value])
    yield Panel(
        "Efforts τ",
        log_series.effort_unit(rollout),
        _lines(rollout.tau, log_series.joint_names(rollout)),
    )


def _null_space(rollout: Rollout) -> Iterator[Series]:
    decay = predicted_decay(rollout)
    for predicted, gain in zip((decay.slow, decay.fast), decay.gains, strict=True):
        if predicted is not None:
            yield Series(
                f"predicted: exp(−{gain:g} t)",
                predicted,
                palette.INK,
                dashed=True,
                predicted=True,
            )
            if decay.fast is decay.slow:
                break
    yield Series("‖e_N‖", rollout["null_space_norm"], palette.FIELD)


def _lines(values: Array, names: Sequence[str]) -> list[Series]:
    """Return one curve per column; of very many, those that vary most."""
    count = len(names) if len(names) <= _MAX_CURVES else _SELECTED
    order = np.argsort(-np.ptp(values, axis=0), kind="stable")[:count]
    return [
        Series(
            names[column],
            values[:, column],
            palette.series(place),
            place >= len(palette.SERIES),
        )
        for place, column in enumerate(sorted(order.tolist()))
    ]


def _packed(panel: Panel, times: Array, arrays: ArrayTable) -> Json:
    all_values = [np.asarray(series.values, float) for series in panel.series]
    measured = [s.values for s in panel.series if not s.predicted]
    low, high = _range(panel, np.concatenate(measured))
    bound = CURVE_BOUND * (high - low)
    curves = []
    for series, values in zip(panel.series, all_values, strict=True):
        shown = values
        if panel.logarithmic:
            with np.errstate(divide="ignore", invalid="ignore"):
                shown = np.log10(values)
        # All values outside the axis are clipped to one height beyond its end.
        span = high - low
        shown = np.nan_to_num(shown, nan=low - span).clip(low - span, high + span)
        shown = shown[:, None]
        step = bound / 8.0
        rounded = step * np.rint(shown / step)
        keys = keyframe_rows(times, shown, rounded, linear, distance_error(bound))
        curves.append(
            {
                "name": series.name,
                "color": series.color,
                "dashed": series.dashed,
                "times": arrays.numbers(times[keys], CLOCK_STEP, np.float64),
                "values": arrays.numbers(rounded[keys], step),
            }
        )
    return {
        "title": panel.title,
        "unit": panel.unit,
        "logarithmic": panel.logarithmic,
        "zero": panel.zero,
        "low": low,
        "high": high,
        "series": curves,
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
    if panel.zero:
        low, high = min(low, 0.0), max(high, 0.0)
    room = 0.06 * (high - low) or max(0.05 * abs(low), 0.5)
    return low - room, high + room
