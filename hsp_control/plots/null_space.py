"""Self-motion: its error e_N against the decay that the law promises, and the field."""

from typing import NamedTuple

import numpy as np
import scipy.linalg
from matplotlib.axes import Axes

from hsp_control import palette
from hsp_control.arrays import Array
from hsp_control.plots.legends import legend_below, note, plain
from hsp_control.plots.lines import (
    draw_lines,
    log_scale,
    mark_damped,
    single,
    time_axis,
)
from hsp_control.readings import (
    column_unit,
    constant_metric,
    distances,
    field_terms,
    position_unit,
)
from hsp_control.simulation import Rollout

ROUNDING = 1e-12
"""‖e_N(0)‖ over the speeds that it is made of, below which it is rounding."""


class Decay(NamedTuple):
    """What the law promises of ‖e_N‖_W, or why it promises nothing.

    Attributes:
        slow: Upper bound, shape (N,); None without a promise.
        fast: Lower bound, shape (N,); the same array for a scalar gain.
        gains: The rates of both bounds [1/s].
        why_not: Why there is no prediction.
    """

    slow: Array | None
    fast: Array | None
    gains: tuple[float, float]
    why_not: str


def predicted_decay(rollout: Rollout) -> Decay:
    """Return ‖e_N(0)‖_W exp(-K_N t), law.md §2, or bounds for a matrix K_N.

    V' = -e_NᵀW K_N e_N lies between -2V times the greatest and the least eigenvalue of
    the symmetric part of W K_N relative to W.
    """
    if not rollout.meta.get("controls_null_space", True):
        why = "no prediction: self-motion is not controlled"
        return Decay(None, None, (0.0, 0.0), why)
    K_N = np.asarray(rollout.meta["null_space_gain"], dtype=float)
    multiple = K_N[0, 0] * np.eye(len(K_N))
    scalar = np.array_equal(K_N, multiple)
    W = np.eye(len(K_N)) if scalar else constant_metric(rollout)
    if W is None:
        why = "no prediction: $K_N$ is a matrix, $W$ not in the log"
        return Decay(None, None, (0.0, 0.0), why)
    power = 0.5 * (W @ K_N + (W @ K_N).T)
    rates = scipy.linalg.eigh(power, W, eigvals_only=True)
    slowest, fastest = float(rates[0]), float(rates[-1])
    norm, elapsed = rollout["null_space_norm"], rollout.t - rollout.t[0]
    speeds = np.linalg.norm(rollout["field.g"], axis=1)
    speeds = speeds + np.linalg.norm(rollout.v, axis=1)
    if not norm[0] > ROUNDING * float(speeds.max()):
        why = "no prediction: starts with $e_N$ = 0"
        return Decay(None, None, (slowest, fastest), why)
    slow = norm[0] * np.exp(-slowest * elapsed)
    fast = slow if scalar else norm[0] * np.exp(-fastest * elapsed)
    return Decay(slow, fast, (slowest, fastest), "")


def draw_null_space_error(axes: Axes, rollout: Rollout) -> None:
    """Draw ‖e_N‖_W and its predicted decay, on a logarithmic scale."""
    t, norm = rollout.t, rollout["null_space_norm"]
    decay = predicted_decay(rollout)
    slowest, fastest = decay.gains
    if decay.slow is not None and decay.fast is not None:
        if decay.fast is decay.slow:
            axes.plot(
                t,
                decay.slow,
                color=palette.INK,
                linewidth=1.2,
                linestyle=(0, (4, 3)),
                zorder=2.5,
                label=rf"predicted: exp(−$K_N$ t), $K_N$ = {slowest:g} 1/s",
            )
        else:
            axes.fill_between(
                t,
                decay.fast,
                decay.slow,
                color=palette.MUTED,
                alpha=0.25,
                linewidth=0.0,
                label=f"predicted: between exp(−{slowest:g} t) and exp(−{fastest:g} t)",
            )
    axes.plot(
        t,
        norm,
        color=palette.FIELD,
        marker=single(t),
        label=r"actual $\Vert e_N \Vert_W$",
    )
    if decay.why_not:
        note(axes, decay.why_not)
    mark_damped(axes, rollout)
    log_scale(axes, norm, top=1e-6)
    axes.set_ylabel(rf"$\Vert e_N \Vert_W$ [{_norm_unit(rollout)}]")
    time_axis(axes, t)
    legend_below(axes)


def draw_field_value(axes: Axes, rollout: Rollout) -> None:
    """Draw the cost that the field descends, or the norm of a vector field."""
    t = rollout.t
    name = plain(str(rollout.meta.get("field", "field")))
    values = rollout["field.value"]
    axes.plot(t, values, color=palette.FIELD, marker=single(t), label=name)
    if float(np.ptp(values)) == 0.0:
        axes.set_ylim(float(values[0]) - 0.5, float(values[0]) + 0.5)
    unit = column_unit(rollout, "field.value")
    axes.set_ylabel(f"value of the field [{unit}]")
    time_axis(axes, t)
    legend_below(axes)


def draw_field_terms(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every term's share of g, which shows what rules when."""
    names = field_terms(rollout)
    shares = [np.linalg.norm(rollout[f"field.{name}.g"], axis=1) for name in names]
    draw_lines(axes, rollout.t, np.column_stack(shares), names)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(rf"share $\Vert g_k \Vert$ [{_rate_unit(rollout)}]")
    time_axis(axes, rollout.t)
    legend_below(axes)


def draw_distances(axes: Axes, rollout: Rollout) -> None:
    """Draw the least distance that each field watches; below zero is contact."""
    names = distances(rollout)
    values = np.column_stack([rollout[f"distance.{name}"] for name in names])
    draw_lines(axes, rollout.t, values, names)
    axes.axhline(0.0, color=palette.OBSTACLE, linewidth=1.0, zorder=1.0)
    axes.set_ylabel("least distance [m]")
    time_axis(axes, rollout.t)
    legend_below(axes)


def _norm_unit(rollout: Rollout) -> str:
    """Return the norm's unit; in the mass matrix it is the root of twice an energy."""
    if rollout.meta.get("metric") == "MassMatrixMetric":
        return "√J"
    return _rate_unit(rollout)


def _rate_unit(rollout: Rollout) -> str:
    unit = position_unit(rollout)
    return f"({unit})/s" if " " in unit else f"{unit}/s"
