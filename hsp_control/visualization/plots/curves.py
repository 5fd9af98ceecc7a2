"""Curves of a run over time: task errors, joints, singularities, self-motion."""

import numpy as np
from matplotlib.axes import Axes

from hsp_control.simulation import Rollout
from hsp_control.simulation.log_series import (
    column_unit,
    effort_units,
    field_terms,
    held_period,
    joint_names,
    joint_positions,
    logged_distances,
    position_units,
    predicted_decay,
    rate_unit,
    task_errors,
)
from hsp_control.visualization import palette
from hsp_control.visualization.plots.lines import (
    draw_lines,
    finish_time_axis,
    literal_text,
    log_scale,
    mark_damped,
    note,
    point_marker,
)

_UNIT_DASHES = {"rad": "--", "–": ":"}
"""Line styles by unit: all units share one axis; the legend names them."""


def draw_task_errors(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every task's error, one line per unit, with a log axis."""
    t, parts = rollout.t, task_errors(rollout)
    if not parts:
        note(axes, "the log has no task")
    for part in parts:
        axes.plot(
            t,
            part.norm,
            color=palette.task(part.task),
            linestyle=_UNIT_DASHES.get(part.unit, "-"),
            marker=point_marker(t),
            label=literal_text(f"{part.label} [{part.unit}]"),
        )
    mark_damped(axes, rollout)
    norms = [np.zeros(0), *(part.norm for part in parts)]
    log_scale(axes, np.concatenate(norms), top=1e-6)
    units = ", ".join(dict.fromkeys(part.unit for part in parts))
    axes.set_ylabel(rf"task error $\Vert e \Vert$ [{units}]")
    finish_time_axis(axes, t)


def draw_joint_positions(
    axes: Axes, rollout: Rollout, *, absolute: bool = True
) -> None:
    """Draw the joint positions, unwrapped: not limited to one turn."""
    positions, what = joint_positions(rollout, absolute=absolute)
    names, units = joint_names(rollout), position_units(rollout)
    unit = draw_lines(axes, rollout.t, positions, names, units)
    axes.set_ylabel(f"{what} [{unit}]")
    finish_time_axis(axes, rollout.t)


def draw_efforts(axes: Axes, rollout: Rollout) -> None:
    """Draw the joints' efforts tau."""
    names, units = joint_names(rollout), effort_units(rollout)
    unit = draw_lines(axes, rollout.t, rollout.tau, names, units)
    axes.set_ylabel(f"effort τ [{unit}]")
    finish_time_axis(axes, rollout.t)


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
    finish_time_axis(axes, t)


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
    finish_time_axis(axes, rollout.t)


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
    finish_time_axis(axes, t)


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
    finish_time_axis(axes, t)


def draw_field_terms(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every term's contribution to g: which term dominates when."""
    names = field_terms(rollout)
    norms = [np.linalg.norm(rollout[f"field.{name}.g"], axis=1) for name in names]
    draw_lines(axes, rollout.t, np.column_stack(norms), names)
    axes.set_ylim(bottom=0.0)
    axes.set_ylabel(rf"contribution $\Vert g_k \Vert$ [{rate_unit(rollout)}]")
    finish_time_axis(axes, rollout.t)


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
    finish_time_axis(axes, rollout.t)
