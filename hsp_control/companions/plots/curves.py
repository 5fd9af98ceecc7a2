"""Curves of a run over time: task errors, joints, singularities, self-motion."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.mathtext import MathTextParser
from matplotlib.transforms import ScaledTranslation

from hsp_control.common.arrays import Array
from hsp_control.common.unicode_text import encodable
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.analysis import floor_of
from hsp_control.companions.plots.log_series import (
    MAX_NAMED,
    decay_power,
    field_terms,
    held_period,
    joint_names,
    joint_positions,
    limit,
    lively,
    logged_distances,
    predicted_decay,
    spans_of,
)
from hsp_control.simulation import Rollout
from hsp_control.simulation.measures import (
    LIMITED,
    column_unit,
    effort_units,
    position_units,
    rate_unit,
    task_errors,
)

_WIDE = 4.5  # width of a figure [inches]
_LEGEND = 8.4  # font size of legends [pt]
_HANDLE, _GAP, _LETTER = 2.2, 1.3, 0.55
"""Widths in a legend over its font size: handle, gap of columns, mean letter."""


def legend_below(axes: Axes) -> None:
    """Add a legend of all labelled artists, if there are any, below the axes."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    figure = axes.get_figure(root=False)
    # Height of the tick labels below the axes [pt].
    drop = 32.0 if axes.axison else 22.0
    below = ScaledTranslation(0.0, -drop / 72.0, figure.dpi_scale_trans)  # type: ignore[union-attr]
    axes.legend(
        handles,
        labels,
        loc="upper left",
        bbox_to_anchor=(0.0, 0.0),
        bbox_transform=axes.transAxes + below,
        ncols=_fitting(axes, labels),
    )


def note(axes: Axes, text: str) -> None:
    """Add a note to the legend; call it before `legend_below`."""
    axes.plot([], [], linestyle="none", label=text)


def math_text(name: str) -> str:
    """Return a name in which ``$K_N$`` is mathematics, if that can be drawn."""
    name = encodable(name)
    if name.count("$") and not name.count("$") % 2:
        try:
            MathTextParser("path").parse(name)
        except ValueError:
            return literal_text(name)
        return f" {name}" if name.startswith("_") else name
    return literal_text(name)


def literal_text(name: str) -> str:
    """Return a text that matplotlib shows as it is, also with $ or a leading _."""
    shown = encodable(name).replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown


def _fitting(axes: Axes, labels: Sequence[str]) -> int:
    """Return the number of columns of a legend that fit below the axes."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    # The layout is computed later: a narrow figure leaves less space beside the labels.
    share = 1.1 if figure.get_figwidth() > _WIDE else 0.9
    return columns_within(axes.get_window_extent().width / figure.dpi * share, labels)


def columns_within(
    inches: float, labels: Sequence[str], handle: float = _HANDLE
) -> int:
    """Return the number of columns of a legend that fit into a width.

    Args:
        inches: The width.
        labels: The texts of its entries, which run down the columns.
        handle: Width beside a text, over the font size.
    """
    width = inches * 72.0 / _LEGEND
    for columns in range(len(labels), 1, -1):
        rows = -(-len(labels) // columns)
        wide = sum(
            max(map(len, labels[start : start + rows])) * _LETTER + handle + _GAP
            for start in range(0, len(labels), rows)
        )
        if wide - _GAP <= width:
            return -(-len(labels) // rows)
    return 1


_DASHES = ("-", "--", ":", "-.")  # neighbours differ without their colours, too
_NEAR = 0.2  # a limit is near within this share of a joint's own range


def draw_lines(
    axes: Axes,
    t: Array,
    values: Array,
    names: Sequence[str],
    units: Sequence[str] | None = None,
    limits: tuple[Array, Array] | None = None,
) -> str:
    """Draw one line per column, named in the legend; return the units of the lines.

    If the named lines differ in their units, names show them; lines without a name are
    drawn only if they share a unit with named ones. A lower or upper limit of a named
    line is drawn if it comes near. Shapes: t (N,), values (N, k), limits (k,).
    """
    units = list(units or [""] * len(names))
    named = lively(values)
    shown = {units[k] for k in named}
    others = [k for k in range(len(names)) if k not in named and units[k] in shown]
    for k in others:
        axes.plot(t, values[:, k], color=palette.MUTED, linewidth=0.6, alpha=0.5)
    kinds = list(dict.fromkeys(units[k] for k in named))
    for place, k in enumerate(named):
        name = literal_text(names[k])
        axes.plot(
            t,
            values[:, k],
            marker=point_marker(t),
            color=palette.series(place),
            linestyle=_DASHES[place % len(_DASHES)],
            label=f"{name} [{units[k]}]" if len(kinds) > 1 else name,
        )
    if others:
        note(axes, f"{len(others)} others (grey)")
    label: str | None = "limits"
    for place, k in enumerate(named):
        low, high = (each[k] for each in limits) if limits else (-np.inf, np.inf)
        for edge in (low, high) if high < np.inf else ():
            near = np.abs(values[:, k] - edge) <= _NEAR * (high - low)  # NaN is not
            if near.any():
                color, dotted = palette.series(place), (0, (1, 1.5))
                axes.axhline(
                    edge, color=color, linewidth=0.9, linestyle=dotted, label=label
                )
                label = None
    return ", ".join(kinds)


def point_marker(t: Array) -> str:
    """Return the marker of a line over ``t``: a single point is invisible without."""
    return "o" if len(t) == 1 else ""


def finish(axes: Axes, rollout: Rollout, label: str) -> None:
    """Mark steps, label both axes, fit that of time to the log, and add the legend."""
    t = rollout.t
    mark_steps(axes, rollout)
    axes.set(xlabel="time [s]", ylabel=label)
    if t[-1] > t[0]:
        axes.set_xlim(float(t[0]), float(t[-1]))
    legend_below(axes)


def log_scale(axes: Axes, values: Array, *, top: float = 0.0) -> None:
    """Make the y axis logarithmic, up to ``top`` at least: rounding looks small."""
    floor = 1e-17  # values up to it are rounding errors and do not extend the axis
    shown = values[np.isfinite(values) & (values > floor)]
    highest = max(float(shown.max(initial=floor)), top)
    # A norm that crosses zero has dips at single rows; the axis ignores them.
    lowest = float(np.quantile(shown, 0.005)) if shown.size else highest
    axes.set_ylim(max(0.4 * lowest, floor), 3.0 * max(highest, 10.0 * floor))
    axes.set_yscale("log")  # after the limits: there may be no positive value


def mark_steps(axes: Axes, rollout: Rollout) -> None:
    """Shade the times of steps that deviate from the law: limited, bounded, damped."""
    columns, limited = rollout.columns, np.zeros(len(rollout), bool)
    if "status" in columns:
        limited = rollout["status"] >= LIMITED
    far = [columns[name] > 0.0 for name in columns if name.endswith(".bounded")]
    for words, color, active in (
        ("limited", palette.DESIRED, limited),
        ("error bounded", palette.TASK, np.any([0.0 * limited, *far], axis=0)),
        ("damped near a singularity", palette.WARNING, rollout["damped"] > 0.0),
    ):
        label: str | None = words
        for start, stop in spans_of(rollout.t, active):
            axes.axvspan(
                start, stop, color=color, alpha=0.15, linewidth=0.8, label=label
            )
            label = None


def mark_frames(axes: Axes, times: Array) -> None:
    """Mark the times of frames with their numbers, from 1, at the upper edge."""
    upper = axes.secondary_xaxis("top")
    upper.set_xticks(times, labels=_spaced_numbers(axes, times))
    upper.tick_params(length=2.0, pad=1.0, labelsize=8.4, labelcolor=palette.MUTED)
    upper.spines["top"].set_visible(False)


def _spaced_numbers(axes: Axes, times: Array) -> list[str]:
    """Return the numbers of frames, without those that would overlap."""
    if len(times) > MAX_NAMED:
        return [""] * len(times)
    figure = axes.get_figure(root=True)
    assert figure is not None
    wide = axes.get_window_extent().width / figure.dpi * 72.0
    places = (times - times[0]) * wide / np.ptp(axes.get_xlim())
    texts, shown = [""] * len(times), list[float]()
    for k in (0, len(times) - 1, *range(1, len(times) - 1)):  # the ends first
        if all(abs(places[k] - other) >= _LEGEND for other in shown):
            texts[k] = str(k + 1)
            shown.append(places[k])
    return texts


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
    norms = [np.zeros(0), *(part.norm for part in parts)]
    log_scale(axes, np.concatenate(norms), top=1e-6)
    units = ", ".join(dict.fromkeys(part.unit for part in parts))
    finish(axes, rollout, rf"task error $\Vert e \Vert$ [{units}]")


def draw_joint_positions(
    axes: Axes, rollout: Rollout, *, absolute: bool = True
) -> None:
    """Draw the joint positions, unwrapped: not limited to one turn."""
    positions, what = joint_positions(rollout, absolute=absolute)
    own = "absolute" not in what  # limits are those of the joints
    limits = (limit(rollout, "lower"), limit(rollout, "upper")) if own else None
    _draw_joints(axes, rollout, what, positions, position_units(rollout), limits)


def draw_speeds(axes: Axes, rollout: Rollout) -> None:
    """Draw the joints' speeds, with the limits that they come near."""
    units, most = position_units(rollout), limit(rollout, "velocity")
    units = [f"{unit}/s" for unit in units]
    _draw_joints(axes, rollout, "joint speed", rollout.v, units, (-most, most))


def draw_efforts(axes: Axes, rollout: Rollout) -> None:
    """Draw the joints' efforts tau, with the limits that they come near."""
    units, most = effort_units(rollout), limit(rollout, "effort")
    _draw_joints(axes, rollout, "effort τ", rollout.tau, units, (-most, most))


def _draw_joints(
    axes: Axes,
    rollout: Rollout,
    what: str,
    values: Array,
    units: Sequence[str],
    limits: tuple[Array, Array] | None,
) -> None:
    names = joint_names(rollout)
    unit = draw_lines(axes, rollout.t, values, names, units, limits)
    finish(axes, rollout, f"{what} [{unit}]")


_SUBSCRIPTS = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")


def draw_determinant(axes: Axes, rollout: Rollout) -> None:
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
    maximum = float(values[np.isfinite(values)].max(initial=1e-12))
    axes.set_ylim(0.0, 1.08 * maximum)
    unit = column_unit(rollout, "manipulability")
    finish(axes, rollout, rf"$\det(J\,W^{{-1}}J^{{\mathsf{{T}}}})$ [{unit}]")


def draw_singular_values(axes: Axes, rollout: Rollout) -> None:
    """Draw the singular values of the stacked task Jacobian in the metric W = L Lᵀ."""
    values = rollout["singular_values"]
    names = [f"σ{k + 1}".translate(_SUBSCRIPTS) for k in range(values.shape[1])]
    draw_lines(axes, rollout.t, values, names)
    known = values[np.isfinite(values)]
    if known.size and known.min() < 0.05 * known.max():
        log_scale(axes, values)
    else:
        axes.set_ylim(bottom=0.0)
    unit = column_unit(rollout, "singular_values")
    finish(axes, rollout, rf"singular values of $J\,L^{{-\mathsf{{T}}}}$ [{unit}]")


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
    if decay.slow is not None and (floor := floor_of(rollout)) is not None:
        axes.fill_between(
            t,
            np.maximum(floor, 1e-300),
            1e-300,
            color=palette.MUTED,
            alpha=0.22,
            linewidth=0.0,
            zorder=0.5,
            label="expected floor of the held effort",
        )
    if decay.why_not:
        note(axes, decay.why_not)
    if period := held_period(rollout):
        note(axes, f"effort held for {1e3 * period:g} ms")
    log_scale(axes, norm, top=1e-6)
    finish(axes, rollout, rf"$\Vert e_N \Vert_W$ [{rate_unit(rollout)}]")


def draw_decay(axes: Axes, rollout: Rollout) -> None:
    """Draw -V' and its value by the law, e_NᵀW K_N e_N, with a logarithmic axis.

    V = ½ e_NᵀW e_N is computed from the log's rows, and V' = V (ln V)' by differences
    of them: exact where V decays exponentially.
    """
    t, power = rollout.t, decay_power(rollout)
    V = 0.5 * rollout["null_space_norm"] ** 2
    known = (V > 0.0) & (np.diff(t, prepend=-np.inf) > 0.0)  # a time may be repeated
    fall = np.full(len(t), np.nan)
    if known.sum() > 1:
        fall[known] = -V[known] * np.gradient(np.log(V[known]), t[known])
    if power is not None:
        axes.plot(
            t,
            np.where(power > 0.0, power, np.nan),
            color=palette.INK,
            linewidth=1.2,
            linestyle=(0, (4, 3)),
            zorder=2.5,
            label=r"law: $e_N^{\mathsf{T}} W K_N e_N$",
        )
    else:
        note(axes, "no prediction: $K_N$ or $W$ not in the log")
    axes.plot(
        t,
        np.where(fall > 0.0, fall, np.nan),
        color=palette.FIELD,
        marker=point_marker(t),
        label=r"actual $-\dot V$, differences of the rows",
    )
    shown = fall[np.isfinite(fall)] if power is None else power
    log_scale(axes, shown[shown > 0.0], top=1e-12)
    unit = rate_unit(rollout)
    finish(axes, rollout, rf"$-\dot V$ [{unit.removesuffix('/s')}²/s³]")


def draw_field_value(axes: Axes, rollout: Rollout) -> None:
    """Draw the field's value: its cost, or the norm of a vector field."""
    t = rollout.t
    name = literal_text(str(rollout.meta.get("field", "field")))
    values = rollout["field.value"]
    axes.plot(t, values, color=palette.FIELD, marker=point_marker(t), label=name)
    if float(np.ptp(values)) == 0.0:
        axes.set_ylim(float(values[0]) - 0.5, float(values[0]) + 0.5)
    unit = column_unit(rollout, "field.value")
    finish(axes, rollout, f"field value [{unit}]")


def draw_field_terms(axes: Axes, rollout: Rollout) -> None:
    """Draw the norm of every term's contribution to g, which shows the dominant one."""
    names = field_terms(rollout)
    norms = [np.linalg.norm(rollout[f"field.{name}.g"], axis=1) for name in names]
    draw_lines(axes, rollout.t, np.column_stack(norms), names)
    axes.set_ylim(bottom=0.0)
    finish(axes, rollout, rf"contribution $\Vert g_k \Vert$ [{rate_unit(rollout)}]")


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
    finish(axes, rollout, "minimum distance [m]")
