"""Distance from singularities: manipulability and singular values."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import column_unit
from hsp_control.visualization import palette
from hsp_control.visualization.plots.legends import legend_below
from hsp_control.visualization.plots.lines import (
    draw_lines,
    log_scale,
    mark_damped,
    point_marker,
    time_axis,
)

_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def draw_manipulability(axes: Axes, rollout: Rollout) -> None:
    """Draw det(J W⁻¹ Jᵀ), the square of Yoshikawa's measure, and mark its minimum."""
    t, values = rollout.t, rollout["manipulability"]
    axes.plot(t, values, color=palette.TASK, marker=point_marker(t))
    minimum = int(np.argmin(values))
    axes.plot(
        t[minimum],
        values[minimum],
        linestyle="none",
        marker="o",
        markersize=6.5,
        markerfacecolor=palette.PAPER,
        markeredgecolor=palette.WARNING,
        markeredgewidth=1.6,
        clip_on=False,
        zorder=3,
        label=f"minimum {values[minimum]:.3g} at {t[minimum]:.2f} s",
    )
    mark_damped(axes, rollout)
    maximum = float(values[np.isfinite(values)].max(initial=1e-12))
    axes.set_ylim(0.0, 1.08 * maximum)
    unit = column_unit(rollout, "manipulability")
    axes.set_ylabel(rf"$\det(J\,W^{{-1}}J^{{\mathsf{{T}}}})$ [{unit}]")
    time_axis(axes, t)
    legend_below(axes)


def draw_singular_values(axes: Axes, rollout: Rollout) -> None:
    """Draw the singular values of the stacked task Jacobian in the metric W = L Lᵀ."""
    values = rollout["singular_values"]
    names = [f"σ{k + 1}".translate(_SUBSCRIPTS) for k in range(values.shape[1])]
    draw_lines(axes, rollout.t, values, names)
    mark_damped(axes, rollout)
    if float(values.min()) < 0.05 * float(values.max()):
        log_scale(axes, values)
    else:
        axes.set_ylim(bottom=0.0)
    unit = column_unit(rollout, "singular_values")
    axes.set_ylabel(rf"singular values of $J\,L^{{-\mathsf{{T}}}}$ [{unit}]")
    time_axis(axes, rollout.t)
    legend_below(axes)
