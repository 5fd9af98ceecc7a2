"""The plots beside the scene: which curves of a log they show."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.simulation import Rollout, log_series
from hsp_control.simulation.decay import predicted_decay
from hsp_control.simulation.log_distances import logged_distances
from hsp_control.visualization import palette
from hsp_control.visualization.viewer.packed.held_effort import expected_floor

_MAX_CURVES, _SELECTED = 14, 7
"""Of more than 14 curves, only the 7 that vary most are shown."""


class Series(NamedTuple):
    """One curve."""

    name: str  # its name in the legend
    values: Array  # one per row of the log, (N,)
    color: str  # its colour, ``#RRGGBB``
    dashed: bool = False
    # It is a prediction, not measured: the axis need not reach it.
    predicted: bool = False
    band: bool = False  # fill the plot below it


class Edge(NamedTuple):
    """A value that curves must not fall below, drawn as a line: contact."""

    value: float  # the value, in the panel's unit
    name: str  # its label; "" for zero, which needs none


class Panel(NamedTuple):
    """One plot over time."""

    title: str
    unit: str  # the unit of the curves
    series: Sequence[Series]
    logarithmic: bool = False  # whether its axis is logarithmic
    edges: Sequence[Edge] = ()  # values that the axis includes and draws as lines
    note: str = ""  # A remark beside the title, or ""


def panels_of(rollout: Rollout, controller: Controller | None = None) -> list[Panel]:
    """Return the plots of a log, without those whose columns it lacks."""
    return list(_panels(rollout, controller))


def _panels(rollout: Rollout, controller: Controller | None) -> Iterator[Panel]:
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
    period = log_series.held_period(rollout)
    yield Panel(
        "Null-space error ‖e_N‖",
        log_series.rate_unit(rollout),
        list(_null_space(rollout, controller)),
        logarithmic=True,
        note=f"effort held for {1e3 * period:g} ms" if period else "",
    )
    watched = logged_distances(rollout)
    if watched:
        values = np.column_stack([each.values for each in watched])
        curves, unit = _lines(values, [each.label for each in watched])
        edges = dict.fromkeys(
            Edge(each.edge, each.edge_name) for each in watched if each.edge is not None
        )
        yield Panel("Minimum distance", "m", curves, edges=list(edges))
    joints = log_series.joint_names(rollout)
    some = f"{_SELECTED} of {len(joints)}" if len(joints) > _MAX_CURVES else ""
    positions, what = log_series.joint_positions(rollout)
    curves, unit = _lines(positions, joints, log_series.position_units(rollout))
    yield Panel(what.capitalize() + "s", unit, curves, note=some)
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
    curves, unit = _lines(rollout.tau, joints, log_series.effort_units(rollout))
    yield Panel("Efforts τ", unit, curves, note=some)


def _null_space(rollout: Rollout, controller: Controller | None) -> Iterator[Series]:
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
    floor = expected_floor(rollout, controller)
    if floor is not None:
        name = "held effort: expected floor"
        yield Series(name, floor, palette.MUTED, predicted=True, band=True)


def _lines(
    values: Array, names: Sequence[str], units: Sequence[str] | None = None
) -> tuple[list[Series], str]:
    """Return one curve per column (of many, those that vary most), and units."""
    count = len(names) if len(names) <= _MAX_CURVES else _SELECTED
    order = np.argsort(-np.ptp(values, axis=0), kind="stable")[:count]
    units = list(units or [""] * len(names))
    kinds = list(dict.fromkeys(units[column] for column in sorted(order.tolist())))
    mixed = len(kinds) > 1
    curves = [
        Series(
            f"{names[column]} [{units[column]}]" if mixed else names[column],
            values[:, column],
            palette.series(place),
            place >= len(palette.SERIES),
        )
        for place, column in enumerate(sorted(order.tolist()))
    ]
    return curves, ", ".join(kinds)
