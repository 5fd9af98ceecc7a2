"""Latency of a control loop: its distribution, and its course over time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from hsp_control.common.arrays import Array
from hsp_control.live.latency import Latency
from hsp_control.visualization import palette
from hsp_control.visualization.plots.legends import legend_below, literal_text
from hsp_control.visualization.plots.style import new_figure, styled


def latency_figure(latency: Latency, title: str) -> Figure:
    """Return a figure of the loop's times.

    (a) the share of periods that took longer than a time, (b) the times in order.

    Args:
        latency: The measurement.
        title: The figure's title.
    """
    with styled():
        figure = new_figure(10.0, 4.2)
        figure.suptitle(literal_text(title))
        distribution, course = figure.subplots(1, 2)
        _draw_exceedance(distribution, latency)
        _draw_course(course, latency)
    return figure


def _draw_exceedance(axes: Axes, latency: Latency) -> None:
    curves = [
        ("step: state and law", latency.step, palette.ACTUAL, "-"),
        (
            "step, back to back without a clock",
            latency.back_to_back,
            palette.ACTUAL,
            ":",
        ),
        ("start of period to effort", latency.response, palette.OBSTACLE, "--"),
        ("wake-up, empty loop", latency.empty, palette.MUTED, "-."),
    ]
    for name, times, color, dashes in curves:
        ordered = np.sort(times)[::-1] * 1e6
        share = np.arange(1, len(ordered) + 1) / len(ordered)
        axes.plot(ordered, share, dashes, color=color, label=name)
    axes.axvline(latency.period * 1e6, color=palette.INK, linewidth=1.0, label="period")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_xlabel("time [µs]")
    axes.set_ylabel("share of periods that took longer")
    axes.set_title("(a)  Distribution")
    legend_below(axes)


def _draw_course(axes: Axes, latency: Latency) -> None:
    for name, times, color, marker, dashes in (
        ("start of period to effort", latency.response, palette.OBSTACLE, "o", "--"),
        ("wake-up, empty loop", latency.empty, palette.MUTED, "x", "-."),
    ):
        _draw_groups(axes, times, latency.period, (color, marker, dashes), name)
    axes.axhline(latency.period * 1e6, color=palette.INK, linewidth=1.0, label="period")
    axes.set_yscale("log")
    axes.set_xlabel("time in the loop [s]")
    axes.set_ylabel("time [µs]")
    axes.set_title("(b)  Over time: medians (lines) and maxima of groups")
    legend_below(axes)


def _draw_groups(
    axes: Axes, times: Array, period: float, style: tuple[str, str, str], name: str
) -> None:
    """Draw median and maximum of groups of periods; all values would overlap."""
    color, marker, dashes = style
    groups = np.array_split(times * 1e6, min(len(times), 200))
    ends = np.cumsum([len(group) for group in groups]) * period
    medians = [np.median(group) for group in groups]
    axes.plot(ends, medians, dashes, color=color, label=name)
    axes.plot(
        ends,
        [group.max() for group in groups],
        color=color,
        linestyle="none",
        marker=marker,
        markersize=3.0,
        alpha=0.6,
    )
