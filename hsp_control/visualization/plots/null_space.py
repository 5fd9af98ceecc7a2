"""Self-motion: the error e_N and its predicted decay, and the field."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.simulation import Rollout
from hsp_control.simulation.decay import predicted_decay
from hsp_control.simulation.log_distances import logged_distances
from hsp_control.simulation.log_series import (
    column_unit,
    field_terms,
    held_period,
    rate_unit,
)
from hsp_control.visualization import palette
from hsp_control.visualization.plots.legends import legend_below, literal_text, note
from hsp_control.visualization.plots.lines import (
    draw_lines,
    log_scale,
    mark_damped,
    point_marker,
    time_axis,
)


def draw_null_space_error(axes: Axes, rollout: Rollout) -> None:
    """Draw ‖e_N‖_W and its predicted decay, with a logarithmic axis."""
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
        marker=point_marker(t),
        label=r"actual $\Vert e_N \Vert_W$",
    )
    if decay.why_not:
        note(axes, decay.why_not)
    if period := held_period(rollout):
        note(axes, f"effort held for {1e3 * period:g} ms")
    mark_damped(axes, rollout)
    log_scale(axes, norm, top=1e-6)
    axes.set_ylabel(rf"$\Vert e_N \Vert_W$ [{rate_unit(rollout)}]")
    time_axis(axes, t)
    legend_below(axes)


def draw_field_value(axes: Axes, rollout: Rollout) -> None:
    """Draw the field's value: its cost, or the norm of a vector field."""
    t = rollout.t
    name = literal_text(str(rollout.meta.get("field", "field")))
    values = rollout["field.value"]
    axes.plot(t, values, color=palette.FIELD, marker=point_marker(t), label=name)
    if float(np.ptp(values)) == 0.0:
        axes.set_ylim(float(values[0]) - 0.5, float(values[0]) + 0.5)
    unit = column_unit(rollout, "field.value")
    axes.set_ylabel(f"field value [{unit}]")
    time_axis(axes, t)
    legend_below(axes)


def draw_field_terms(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every term's contribution to g: which term dominates when."""
    names = field_terms(rollout)
    norms = [np.linalg.norm(rollout[f"field.{name}.g"], axis=1) for name in names]
    draw_lines(axes, rollout.t, np.column_stack(norms), names)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(rf"contribution $\Vert g_k \Vert$ [{rate_unit(rollout)}]")
    time_axis(axes, rollout.t)
    legend_below(axes)


def draw_distances(axes: Axes, rollout: Rollout) -> None:
    """Draw the minimum distances, and a line at each where there is contact."""
    watched = logged_distances(rollout)
    values = np.column_stack([each.values for each in watched])
    draw_lines(axes, rollout.t, values, [each.label for each in watched])
    for edge, name in dict.fromkeys((each.edge, each.edge_name) for each in watched):
        if edge is not None:
            axes.axhline(
                edge,
                color=palette.OBSTACLE,
                linewidth=1.0,
                zorder=1.0,
                label=name or None,
            )
    axes.set_ylabel("minimum distance [m]")
    time_axis(axes, rollout.t)
    legend_below(axes)
