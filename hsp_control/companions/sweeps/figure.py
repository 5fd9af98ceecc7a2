"""Figure of a sweep: every result over every parameter, tinted by its influence."""

import textwrap
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.axis import Axis
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, MaxNLocator, NullLocator

from hsp_control.common.arrays import Array
from hsp_control.common.errors import PlotError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.plots import palette
from hsp_control.companions.plots.curves import literal_text
from hsp_control.companions.plots.figures import (
    inches,
    new_figure,
    save_figure,
    styled,
)
from hsp_control.companions.sweeps.results import Sweep
from hsp_control.companions.sweeps.sensitivities import (
    MIN_RUNS,
    Sensitivity,
    has_order,
    influences,
)

MAX_PARAMETERS, MAX_OUTCOMES = 8, 6
_LOG_RATIO = 30.0  # largest over smallest value, above which an axis is logarithmic
_BINS = 9  # bins of the median, if there are more values
_TINT = "tint: share of variance explained; blue rises, orange falls, purple other"
_GROWS, _FALLS, _EITHER = palette.ACTUAL, palette.DESIRED, palette.FIELD


def save_sweep_figure(
    sweep: Sweep, folder: str | Path, stem: str, formats: Sequence[str] = ("png",)
) -> list[Path]:
    """Write ``<stem>-sensitivity`` in every format."""
    beginning = Path(folder) / f"{stem}-sensitivity"
    return save_figure(sweep_figure(sweep), beginning, formats)


def sweep_figure(
    sweep: Sweep,
    outcomes: Sequence[str] | None = None,
    *,
    parameters: Sequence[str] | None = None,
    width: str | float | None = None,
) -> Figure:
    """Return a figure with a panel for every result over every parameter.

    A panel's tint shows the influence: blue if the result increases with the parameter,
    orange if it decreases, purple for other dependence; its strength is the share of
    the variance of ranks. With few runs it has none.

    Args:
        sweep: The runs.
        outcomes: The results; None: tracking, null space, distances and effort.
        parameters: A selection of those that vary; None: all, or the most influential
        ones.
        width: The width for a paper, such as ``117mm``, or in metres: without heading.

    Raises:
        PlotError: If nothing varies, or a parameter does not.
    """
    found = influences(sweep, outcomes)
    rows = range(min(len(found.outcomes), MAX_OUTCOMES))
    columns = _columns(found, parameters)
    if not columns or not rows:
        raise PlotError("no parameter of this sweep varies: there is nothing to draw")
    wide = 1.5 + 1.75 * len(columns) if width is None else inches(width)
    each = (wide - 1.5) / len(columns)
    with styled():
        figure = new_figure(wide, 1.1 + 1.5 * len(rows))
        if width is None:
            _add_title(figure, sweep)
        _add_foot(figure, sweep, found, letters=round(16.0 * wide))
        grid = figure.subplots(
            len(rows), len(columns), squeeze=False, sharex="col", sharey="row"
        )
        for j in rows:
            for k, i in enumerate(columns):
                _draw_panel(grid[j, k], sweep, found, i, j)
            metric = sweep.meta["metrics"][found.outcomes[j]]
            label = textwrap.fill(f"{metric['meaning']} [{metric['unit']}]", 22)
            grid[j, 0].set_ylabel(literal_text(label), fontsize=8.4)
        for k, i in enumerate(columns):
            grid[-1, k].set_xlabel(
                literal_text(_wrapped(found.parameters[i], round(15.0 * each))),
                fontsize=8.4,
            )
        figure.align_ylabels(grid[:, 0])
    return figure


def _columns(found: Sensitivity, parameters: Sequence[str] | None) -> list[int]:
    """Return the indices of the parameters to show, in the sweep's or given order."""
    if parameters is None:
        # If not all parameters fit, the most influential ones are shown.
        influence = np.nan_to_num(found.share).max(axis=1, initial=0.0)
        order = np.argsort(-influence, kind="stable")
        return sorted(order[:MAX_PARAMETERS].tolist())
    names = list(found.parameters)
    for name in parameters:
        if name not in names:
            near = f"{did_you_mean(name, names)} (there are {listing(names)})"
            raise PlotError(f"no parameter {name!r} varies{near}")
    return [names.index(name) for name in parameters]


def _draw_panel(axes: Axes, sweep: Sweep, found: Sensitivity, i: int, j: int) -> None:
    parameter, outcome = found.parameters[i], found.outcomes[j]
    chosen = sweep.completed
    values, y = sweep[parameter], sweep[outcome].astype(float)
    x = _axis_positions(axes, sweep, parameter)
    count = int(chosen.sum())
    axes.plot(
        x[chosen],
        y[chosen],
        linestyle="none",
        marker="o",
        markersize=float(np.clip(30.0 / np.sqrt(count), 1.2, 4.0)),
        markeredgewidth=0.0,
        color=palette.INK,
        alpha=0.35 if count > 60 else 0.55,
    )
    known = chosen & np.isfinite(y)
    middle_x, middle_y = _medians(x[known], y[known])
    line = "-" if has_order(values) else "none"
    axes.plot(middle_x, middle_y, color=palette.WARNING, linestyle=line, marker="_")
    if _needs_log_axis(y[known]):
        axes.set_yscale("log")
        _label_decades(axes.yaxis, y[known])
    _show_as_equal(axes, y[known])
    if (~chosen).any():  # at the lower edge, for any y axis
        axes.plot(
            x[~chosen],
            np.full(int((~chosen).sum()), 0.02),
            transform=axes.get_xaxis_transform(),
            linestyle="none",
            marker="|",
            markersize=5.0,
            color=palette.OBSTACLE,
        )
    if found.runs >= MIN_RUNS:
        _tint(
            axes, float(found.correlation[i, j]), float(found.share[i, j]), found.noise
        )


def _show_as_equal(axes: Axes, values: Array) -> None:
    """Widen the y axis of values that differ by rounding: its labels would be long."""
    largest = np.abs(values).max(initial=0.0)
    if largest > 0.0 and np.ptp(values) < 1e-9 * largest:
        axes.set_ylim(values[0] - 0.05 * largest, values[0] + 0.05 * largest)


def _tint(axes: Axes, correlation: float, share: float, noise: float) -> None:
    """Colour a panel by the influence, and write the influence above it."""
    share = 0.0 if np.isnan(share) else share
    monotone = not np.isnan(correlation) and abs(correlation) >= noise
    hue = _EITHER
    # A result that increases and decreases has a share but little correlation.
    if monotone and correlation**2 > 0.4 * share:
        hue = _GROWS if correlation > 0.0 else _FALLS
    axes.set_facecolor(palette.blend(palette.PAPER, hue, 0.45 * share))
    words = [f"ρ {correlation:+.2f}"] if monotone else []
    words += [f"{share:.0%}"] if share >= 0.005 else []
    axes.set_title(
        "  ".join(words) or "may be chance",
        fontsize=9.0,
        fontweight="normal" if share < 0.1 else "bold",
        color=palette.INK if words else palette.MUTED,
        pad=3.0,
    )


def _axis_positions(axes: Axes, sweep: Sweep, parameter: str) -> Array:
    """Return a parameter's values as positions on the x axis; set the axis up."""
    values = sweep[parameter]
    if has_order(values):
        numbers = values.astype(float)
        if _is_logarithmic(sweep, parameter):
            axes.set_xscale("log")
            _label_decades(axes.xaxis, numbers)
        else:
            axes.xaxis.set_major_locator(MaxNLocator(4, steps=[1, 2, 5, 10]))
        return np.asarray(numbers)
    names, places = np.unique(values.astype(str), return_inverse=True)
    axes.set_xticks(range(len(names)), [literal_text(name[:14]) for name in names])
    axes.set_xlim(-0.6, len(names) - 0.4)
    return places.astype(float)


def _is_logarithmic(sweep: Sweep, parameter: str) -> bool:
    """Return whether the values were chosen evenly on a logarithmic scale."""
    for factor in sweep.meta["identity"]["factors"]:
        if factor["key"] == parameter:
            if "values" not in factor:
                return bool(factor.get("distribution") == "loguniform")
            numbers = np.sort(np.array(factor["values"], dtype=float))
            if numbers[0] <= 0.0 or len(numbers) < 3:
                return False
            steps = np.diff(np.log(numbers))
            return bool(np.ptp(steps) < 0.5 * steps.mean())
    return False


def _needs_log_axis(values: Array) -> bool:
    """Return whether values span decades, or outliers would flatten the others."""
    smallest, largest = float(values.min()), float(values.max())
    usual = float(np.quantile(values, 0.95))
    return smallest > 0.0 and (largest > _LOG_RATIO * smallest or largest > 3.0 * usual)


def _label_decades(axis: Axis, values: Array) -> None:
    """Label the decades of a logarithmic axis; with few decades also 2 and 5."""
    decades = np.log10(float(values.max()) / float(values.min()))
    axis.set_major_locator(
        LogLocator(subs=(1.0, 2.0, 5.0) if decades < 2.5 else (1.0,))
    )
    axis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axis.set_minor_locator(NullLocator())


def _medians(x: Array, y: Array) -> tuple[Array, Array]:
    """Return the median of y at every value of x, or in bins of equally many runs."""
    levels = np.unique(x)
    if len(levels) <= _BINS:
        bins = [np.flatnonzero(x == level) for level in levels]
    else:
        bins = np.array_split(np.argsort(x, kind="stable"), min(_BINS, len(x) // 4))
    middle = [(np.median(x[each]), np.median(y[each])) for each in bins]
    return np.array([m[0] for m in middle]), np.array([m[1] for m in middle])


def _add_title(figure: Figure, sweep: Sweep) -> None:
    identity = sweep.meta["identity"]
    named = identity["configuration"].get("title") or Path(sweep.meta["name"]).stem
    letters = round(9.5 * figure.get_figwidth())
    figure.suptitle(literal_text(textwrap.fill(str(named), letters)))


def _add_foot(figure: Figure, sweep: Sweep, found: Sensitivity, letters: int) -> None:
    """Write the origin of the runs below the panels, in lines of a maximum length."""
    identity = sweep.meta["identity"]
    failed = len(sweep) - found.runs
    parts = [
        f"{len(sweep)} runs, {identity['design'].replace('_', ' ')}",
        f"seed {identity['seed']}",
        *([f"{failed} not completed (| at the lower edge)"] if failed else []),
        *([_TINT] if found.runs >= MIN_RUNS else []),
        f"hsp_control {identity['versions']['hsp_control']}",
    ]
    figure.supxlabel(
        literal_text(textwrap.fill("  ·  ".join(parts), letters)),
        fontsize=8.4,
        color=palette.MUTED,
        x=0.01,
        ha="left",
    )


def _wrapped(key: str, width: int) -> str:
    """Return a key path, wrapped after dots."""
    lines = [""]
    for part in key.replace(".", ".\0").split("\0"):
        if lines[-1] and len(lines[-1]) + len(part) > width:
            lines.append("")
        lines[-1] += part
    return "\n".join(lines)
