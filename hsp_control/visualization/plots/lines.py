"""Curves over time: colours and names of many lines, log scales, marked intervals."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes

from hsp_control.common.arrays import Array
from hsp_control.simulation import Rollout
from hsp_control.visualization import palette
from hsp_control.visualization.plots.legends import note, plain

MOST, NAMED = 14, 7
"""Of more than 14 lines, only the 7 that vary most get a colour and a name."""
_DASHES = ("-", "--")


def draw_lines(axes: Axes, t: Array, values: Array, names: Sequence[str]) -> None:
    """Draw one line a column, and name them.

    Args:
        axes: The axes.
        t: Time [s], shape (N,).
        values: Shape (N, k).
        names: The columns' names.
    """
    named = list(range(len(names)))
    if len(names) > MOST:
        spread = np.ptp(np.nan_to_num(values, posinf=0.0, neginf=0.0), axis=0)
        named = sorted(np.argsort(-spread, kind="stable")[:NAMED].tolist())
        others = [k for k in range(len(names)) if k not in named]
        for k in others:
            axes.plot(t, values[:, k], color=palette.MUTED, linewidth=0.6, alpha=0.5)
    for place, k in enumerate(named):
        axes.plot(
            t,
            values[:, k],
            marker=single(t),
            color=palette.series(place),
            linestyle=_DASHES[place // len(palette.SERIES) % len(_DASHES)],
            label=plain(names[k]),
        )
    if len(names) > len(named):
        note(axes, f"{len(names) - len(named)} others (grey)")


def single(t: Array) -> str:
    """Return the marker of a line over ``t``: a lone point needs one to be seen."""
    return "o" if len(t) == 1 else ""


def time_axis(axes: Axes, t: Array) -> None:
    """Label the axis of time and fit it to the log."""
    axes.set_xlabel("time [s]")
    if t[-1] > t[0]:
        axes.set_xlim(float(t[0]), float(t[-1]))


def log_scale(
    axes: Axes, values: Array, *, floor: float = 1e-17, top: float = 0.0
) -> None:
    """Make the y axis logarithmic, around those values that such an axis can show.

    Args:
        axes: The axes.
        values: What is drawn.
        floor: What counts as rounding and is not worth an axis.
        top: What the axis reaches at least, so that rounding does not fill it.
    """
    shown = values[np.isfinite(values) & (values > floor)]
    highest = max(float(shown.max(initial=floor)), top)
    # A norm that crosses zero dips at single rows; the axis need not follow.
    lowest = float(np.quantile(shown, 0.005)) if shown.size else highest
    axes.set_ylim(max(0.4 * lowest, floor), 3.0 * max(highest, 10.0 * floor))
    axes.set_yscale("log")  # after the limits: there may be nothing to find them by


def mark_damped(axes: Axes, rollout: Rollout) -> None:
    """Shade the times at which a singularity made the law bounded, not exact."""
    t, damped = rollout.t, rollout["damped"] > 0.0
    edges = np.flatnonzero(np.diff(np.concatenate([[False], damped, [False]])))
    for start, stop in edges.reshape(-1, 2).tolist():
        axes.axvspan(
            float(t[start]),
            float(t[stop - 1]),
            color=palette.WARNING,
            alpha=0.15,
            linewidth=0.8,
            label="law bounded near a singularity" if start == edges[0] else None,
        )


def mark_frames(axes: Axes, times: Array) -> None:
    """Number the times of frames, 1 and on, along the upper edge of curves over time.

    Args:
        axes: The axes.
        times: When the frames were taken [s].
    """
    upper = axes.secondary_xaxis("top")
    few = len(times) <= MOST
    upper.set_xticks(
        times, labels=[str(k + 1) if few else "" for k in range(len(times))]
    )
    upper.tick_params(length=2.0, pad=1.0, labelsize=7.0, labelcolor=palette.MUTED)
    upper.spines["top"].set_visible(False)
