"""Curves, their colours and names, log scales, marked intervals, and legends."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.transforms import ScaledTranslation

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette

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


def literal_text(name: str) -> str:
    """Return a text that matplotlib shows as it is, also with $ or a leading _."""
    shown = name.replace("$", r"\$")
    return f" {shown}" if shown.startswith("_") else shown


def _fitting(axes: Axes, labels: Sequence[str]) -> int:
    """Return how many columns fit below the axes; entries run down the columns."""
    figure = axes.get_figure(root=True)
    assert figure is not None
    width = axes.get_window_extent().width / figure.dpi * 72.0 / 8.0 * 1.1
    for columns in range(len(labels), 1, -1):
        rows = -(-len(labels) // columns)
        wide = sum(
            max(map(len, labels[start : start + rows])) * _LETTER + _HANDLE + _GAP
            for start in range(0, len(labels), rows)
        )
        if wide - _GAP <= width:
            return -(-len(labels) // rows)
    return 1


MAX_NAMED, SELECTED = 14, 7
"""Of more than 14 lines, only the 7 that vary most get a colour and a name."""
_DASHES = ("-", "--", ":", "-.")  # neighbours differ without their colours, too


def draw_lines(
    axes: Axes,
    t: Array,
    values: Array,
    names: Sequence[str],
    units: Sequence[str] | None = None,
) -> str:
    """Draw one line per column, named in the legend; return the units of what is drawn.

    If the named lines differ in their units, names tell them; lines without a name are
    drawn only if they share a unit with named ones. Shapes: t (N,), values (N, k).
    """
    units = list(units or [""] * len(names))
    named, others = list(range(len(names))), []
    if len(names) > MAX_NAMED:
        spread = np.ptp(np.nan_to_num(values, posinf=0.0, neginf=0.0), axis=0)
        named = sorted(np.argsort(-spread, kind="stable")[:SELECTED].tolist())
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
    return ", ".join(kinds)


def point_marker(t: Array) -> str:
    """Return the marker of a line over ``t``: a single point is invisible without."""
    return "o" if len(t) == 1 else ""


def finish_time_axis(axes: Axes, t: Array) -> None:
    """Label the time axis, fit it to the log, and add the legend."""
    axes.set_xlabel("time [s]")
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


def mark_damped(axes: Axes, rollout: Rollout) -> None:
    """Shade the times at which the law is damped near a singularity, not exact."""
    t, damped = rollout.t, rollout["damped"] > 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], damped, [False]])))
    for start, stop in edges.reshape(-1, 2).tolist():
        axes.axvspan(
            float(t[start]),
            float(t[stop - 1]),
            color=palette.WARNING,
            alpha=0.15,
            linewidth=0.8,
            label="damped near a singularity" if start == edges[0] else None,
        )


def mark_frames(axes: Axes, times: Array) -> None:
    """Mark the times of frames with their numbers, from 1, at the upper edge."""
    upper = axes.secondary_xaxis("top")
    few = len(times) <= MAX_NAMED
    upper.set_xticks(
        times, labels=[str(k + 1) if few else "" for k in range(len(times))]
    )
    upper.tick_params(length=2.0, pad=1.0, labelsize=7.0, labelcolor=palette.MUTED)
    upper.spines["top"].set_visible(False)
