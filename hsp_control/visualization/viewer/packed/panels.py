"""The plots beside the scene: which curves of a log they show."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.law import MetricSample
from hsp_control.robot import RobotState
from hsp_control.simulation import Rollout, log_series
from hsp_control.simulation.decay import predicted_decay
from hsp_control.simulation.log_distances import logged_distances
from hsp_control.simulation.log_series import held_period
from hsp_control.visualization import palette
from hsp_control.visualization.viewer.controller_analysis import (
    from_the_start,
    null_space_projector,
)

_COARSEST = 1.0
"""Largest K_N times the time between two rows: else the rows miss what decays."""


def expected_floor(rollout: Rollout, controller: Controller | None) -> Array | None:
    """Return the expected floor of ‖e_N‖_W, shape (N,), to first order in the period.

    The derivation is in ``docs/law.md``, *Sampled control*: an effort that is held for
    h lags the law's by h/2 on average, so that

        e_N' = -K_N e_N + h/2 P M⁻¹ τ'.

    Its solution from e_N = 0 is the floor. The efforts are taken to change linearly
    between two rows. None where the equation is not known or does not hold: without a
    controller, a control period or a gain, with contacts or a floating base, if the law
    changes during the run, or if the rows are too far apart.
    """
    period, gain = held_period(rollout), rollout.meta.get("null_space_gain")
    if controller is None or period is None or gain is None or len(rollout) < 2:
        return None
    if not rollout.meta.get("controls_null_space", True):
        return None
    robot, K_N = controller.robot, np.asarray(gain, float)
    if controller.contacts or robot.unactuated or controller.changes:
        return None
    if K_N.shape != (robot.nv, robot.nv) or rollout.tau.shape[1] != robot.nv:
        return None
    steps = np.diff(rollout.t)
    if not 0.0 < np.linalg.norm(K_N, 2) * steps.max() <= _COARSEST:
        return None
    if np.linalg.cond(K_N) > 1e9 or not np.isfinite(rollout.tau).all():
        return None
    return _solve(rollout, from_the_start(controller), K_N, period)


def _solve(
    rollout: Rollout, controller: Controller, K_N: Array, period: float
) -> Array:
    """Integrate the error equation along the rows; return ‖e_N‖_W, shape (N,)."""
    from scipy.linalg import expm  # here: SciPy takes long to import

    nv = controller.robot.nv
    state = RobotState(controller.robot)
    metric = MetricSample.allocate(nv)
    decays: dict[float, tuple[Array, Array]] = {}
    error, floor = np.zeros(nv), np.zeros(len(rollout))
    for row in range(len(rollout) - 1):
        step = round(float(rollout.t[row + 1] - rollout.t[row]), 9)
        if step not in decays:
            decay = expm(-K_N * step)
            rest = np.linalg.solve(K_N, np.eye(nv) - decay) / max(step, 1e-9)
            decays[step] = decay, np.asarray(rest)
        decay, rest = decays[step]
        state.update(float(rollout.t[row]), rollout.q[row], rollout.v[row])
        change = np.linalg.solve(
            state.mass_matrix, rollout.tau[row + 1] - rollout.tau[row]
        )
        projector = null_space_projector(controller, state)
        error = decay @ error + 0.5 * period * rest @ projector @ change
        error = projector @ error  # the null space turns
        metric = controller.metric.evaluate(state, metric)
        floor[row + 1] = float(np.linalg.norm(metric.L.T @ error))
    return floor


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
