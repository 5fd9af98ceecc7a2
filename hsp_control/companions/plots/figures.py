"""Whole figures: the paper's five panels, diagnostics of a run, their style and files.

No display is needed: figures have an Agg canvas, and pyplot is not imported.
"""

import textwrap
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from io import BytesIO
from itertools import accumulate
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from cycler import cycler
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine
from matplotlib.lines import Line2D

from hsp_control.common.errors import PlotError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.plots import curves, log_series, palette
from hsp_control.companions.plots.frames import (
    columns_for,
    draw_frames,
    draw_superimposed,
)
from hsp_control.companions.plots.paths import draw_end_effector, path_view
from hsp_control.simulation import Rollout, measures

STYLE: dict[str, Any] = {
    "axes.axisbelow": True,
    "axes.edgecolor": palette.MUTED,
    "axes.facecolor": palette.PAPER,
    "axes.grid": True,
    "axes.labelcolor": palette.INK,
    "axes.labelsize": 9.0,
    "axes.linewidth": 0.7,
    "axes.prop_cycle": cycler(color=palette.SERIES),
    "axes.spines.right": False,
    "axes.spines.top": False,
    "axes.titlecolor": palette.INK,
    "axes.titlelocation": "left",
    "axes.titlepad": 7.0,
    "axes.titlesize": 10.0,
    "axes.titleweight": "bold",
    "axes.formatter.useoffset": False,
    "figure.facecolor": palette.PAPER,
    "figure.titlesize": 12.5,
    "figure.titleweight": "bold",
    "font.family": ["DejaVu Sans"],
    "font.size": 9.0,
    "grid.color": palette.GRID,
    "grid.linewidth": 0.6,
    "legend.borderaxespad": 0.0,
    "legend.columnspacing": 1.3,
    "legend.fontsize": 8.4,
    "legend.frameon": False,
    "legend.handlelength": 1.7,
    "legend.handletextpad": 0.5,
    "legend.labelspacing": 0.35,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "mathtext.default": "regular",
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # TrueType, which journals require
    "savefig.dpi": 160,
    "text.color": palette.INK,
    "xtick.color": palette.MUTED,
    "xtick.labelcolor": palette.INK,
    "xtick.labelsize": 8.4,
    "xtick.major.size": 3.0,
    "xtick.minor.size": 1.5,
    "ytick.color": palette.MUTED,
    "ytick.labelcolor": palette.INK,
    "ytick.labelsize": 8.4,
    "ytick.major.size": 3.0,
    "ytick.minor.size": 1.5,
}

NOTEBOOK_DPI = 100.0  # dots per inch of figures in notebooks, which store them as text


@contextmanager
def styled() -> Iterator[None]:
    """Set matplotlib's parameters to `STYLE` within the context."""
    with mpl.rc_context(STYLE):  # type: ignore[arg-type]  # any str may be a key
        yield


def use_style() -> None:
    """Set matplotlib's parameters to `STYLE` permanently, in a notebook or script."""
    mpl.rcParams.update(STYLE)  # type: ignore[arg-type]  # any str may be a key


class StyledFigure(Figure):
    """A figure drawn in the style outside of `styled`, too: ticks are made late."""

    def _repr_png_(self) -> bytes:
        """Return the figure as PNG, for notebooks."""
        image = BytesIO()
        self.savefig(image, format="png", dpi=NOTEBOOK_DPI)
        return image.getvalue()

    def draw(self, renderer: RendererBase) -> None:
        """Draw in the style."""
        with styled():
            super().draw(renderer)


def new_figure(width: float, height: float) -> StyledFigure:
    """Return an empty figure, width and height in inches; call it within `styled`."""
    layout = ConstrainedLayoutEngine(w_pad=0.06, h_pad=0.06)
    figure = StyledFigure(figsize=(width, height), layout=layout)
    FigureCanvasAgg(figure)
    return figure


_HEADING = {"x": 0.01, "ha": "left", "fontsize": 10.0, "fontweight": "bold"}


def paper_figure(
    rollout: Rollout,
    *,
    absolute: bool = True,
    frames: int = 8,
    times: Sequence[float] | None = None,
    title: str | None = None,
    width: str | float | None = None,
) -> Figure:
    """Return the paper's five panels: path, joints, determinant, frames twice.

    Args:
        rollout: The run.
        absolute: Whether angles of joints are absolute if the robot defines them.
        frames: The number of frames, evenly spaced over the run.
        times: Their times instead [s].
        title: The heading; None: the log's title.
        width: The width for a paper, such as ``84mm``, or in metres: without heading
            and foot. Below 150 mm the panels of a plane are in two columns, which at
            117 mm may be printed at 84 mm with text of 6 pt; those of space, and all
            below 110 mm, are stacked.

    Raises:
        PlotError: If the log has no rows, or no frame is requested.
    """
    _check(rollout)
    rows = log_series.chosen_rows(rollout, frames, times)
    if not rows:
        raise PlotError("no frame is requested; needs at least 1")
    wide = 11.0 if width is None else inches(width)
    narrow = wide < _NARROW
    paired = narrow and wide > _ONE_COLUMN and bool(path_view(rollout).names)
    with styled():
        strip_of = (wide, 0.75 * wide) if narrow else (0.62 * wide, 0.245 * wide)
        if paired:
            strip_of = 0.43 * wide, 1.1 * wide
        columns = columns_for(rollout, len(rows), *strip_of)
        if paired:
            # Two columns: a and b, then c above e, and d beside both.
            high = [0.66 * wide, 1.1 * wide]
            figure = new_figure(wide, sum(high))
            first, second = figure.subfigures(
                2, 1, squeeze=False, height_ratios=high
            ).ravel()
            left, right = first.subfigures(1, 2, width_ratios=(0.9, 1.0))
            beside, strip = second.subfigures(1, 2, width_ratios=(1.0, 0.75))
            below, together = beside.subfigures(2, 1, height_ratios=(0.44, 0.66))
            a, b, c = (part.add_subplot() for part in (left, right, below))
        elif narrow:
            # One below the other: a, b, c, then d and e.
            named = len(log_series.lively(rollout.tau))  # in the legend of b
            lines = 0.14 * named if named > 3 else 0.0
            b_high = 0.85 * wide + lines
            high = [0.9 * wide, b_high, 0.75 * wide, 0.75 * wide, 0.9 * wide]
            figure = new_figure(wide, sum(high))
            parts = figure.subfigures(5, 1, squeeze=False, height_ratios=high).ravel()
            a, b, c = (part.add_subplot() for part in parts[:3])
            strip, together = parts[3:]
        else:
            figure = new_figure(wide, 0.69 * wide)
            halves = figure.subfigures(2, 1, squeeze=False, height_ratios=(1.0, 1.05))
            upper, lower = halves.ravel()
            grid = upper.add_gridspec(1, 3, width_ratios=(0.85, 1.0, 1.0))
            a, b, c = (upper.add_subplot(grid[k]) for k in range(3))
            strip, together = lower.subfigures(1, 2, width_ratios=(1.9, 1.0))
        if width is None:
            _add_title(figure, rollout, title)
        draw_end_effector(a, rollout)
        a.set_anchor("NW")
        if paired:
            a.locator_params(nbins=4)
        curves.draw_joint_positions(b, rollout, absolute=absolute)
        third, title = PANELS[
            "determinant" if measures.rows_compare(rollout) else "singular_values"
        ]
        third(c, rollout)
        cells = strip.subplots(-(-len(rows) // columns), columns, squeeze=False)
        draw_frames(cells.ravel().tolist(), rollout, rows, short=narrow)
        for cell in cells.ravel():
            cell.label_outer()
            if paired:  # the axes of e, which have their labels
                cell.set(xlabel="", ylabel="")
        strip.suptitle("(d)  Selected frames", **_HEADING)
        e = together.add_subplot()
        draw_superimposed(e, rollout, rows, letter=0.075 if paired else 0.035)
        e.set_anchor("N")
        together.suptitle("(e)  Frames together", **_HEADING)
        titles = ["End effector", "Joints", title]
        _letter_titles([a, b, c], titles, pad=18.0)  # space for the frames' numbers
        for over_time in (b, c):
            curves.mark_frames(over_time, rollout.t[rows])
    return figure


PANELS: dict[str, tuple[Callable[[Axes, Rollout], None], str]] = {
    "errors": (curves.draw_task_errors, "Task error"),
    "null_space": (curves.draw_null_space_error, "Null-space error"),
    "decay": (curves.draw_decay, "Decay of V"),
    "field": (curves.draw_field_value, "Null-space field"),
    "efforts": (curves.draw_efforts, "Efforts"),
    "singular_values": (curves.draw_singular_values, "Singular values"),
    "determinant": (curves.draw_determinant, "Determinant"),
    "distances": (curves.draw_distances, "Distances"),
    "terms": (curves.draw_field_terms, "The field's terms"),
    "joints": (curves.draw_joint_positions, "Joints"),
    "speeds": (curves.draw_speeds, "Joint speeds"),
}
"""The panels of `diagnostics_figure`, by name: the drawing function and the title."""
_NARROW = 5.9  # width of a figure below which its panels are not in one row [in]
_ONE_COLUMN = 4.33  # width up to which they are one below the other [in]
_SHAPE = 0.72, 0.55  # height of a panel over its width, and its legend's [inches]
_LOG_DASHES: tuple[Any, ...] = ("-", (0, (6, 1.5)), "-.", ":")
"""Line widths of the first log, the second and so on."""
_THIN, _REFERENCE = 1.3, 1.1  # predictions are thinner, limits thinner still [pt]


def diagnostics_figure(
    rollout: Rollout,
    *others: Rollout,
    names: Sequence[str] = (),
    panels: Sequence[str] = (),
    width: str | float | None = None,
    absolute: bool = True,
) -> Figure:
    """Return a figure that compares runs with the law's predictions.

    Args:
        rollout: The run.
        others: Runs to draw in the same panels.
        names: Names of the runs; by default those in their logs.
        panels: The names of the panels, of `PANELS`; by default most of them.
        width: The width for a paper, such as ``84mm``, or in metres: without heading
            and foot. By default it is that of a page.
        absolute: Whether angles of joints are absolute if the robot defines them.

    Raises:
        PlotError: If a log has no rows, or there is no such panel.
    """
    runs = [rollout, *others]
    for each in runs:
        _check(each)
    chosen = _chosen_panels(runs, panels)
    if width is None:
        many = 3 if len(chosen) > 8 else -(-len(chosen) // 2)
        columns = len(chosen) if len(chosen) <= 3 else many
        wide, more = 3.6 * columns, 0.6
    else:
        wide, more = inches(width), 0.0
        columns = min(max(round(wide / 3.0), 1), len(chosen))
    rows = -(-len(chosen) // columns)
    high = rows * (_SHAPE[0] * wide / columns + _SHAPE[1]) + more
    with styled():
        figure = new_figure(wide, high)
        if width is None:
            _add_title(figure, rollout)
        if others:
            figure.suptitle("")  # the names of the logs replace it
            own = [f"{k} {run.meta.get('name', '')}" for k, run in enumerate(runs, 1)]
            _name_logs(figure, names or differing(own))
        axes = figure.subplots(rows, columns, squeeze=False).ravel().tolist()
        for one, name in zip(axes, chosen, strict=False):
            draw = PANELS[name][0]
            if name == "joints":
                draw = partial(curves.draw_joint_positions, absolute=absolute)
            _draw_together(one, draw, runs)
        for unused in axes[len(chosen) :]:
            unused.set_axis_off()
        _letter_titles(axes, [PANELS[name][1] for name in chosen])
    return figure


def _chosen_panels(runs: Sequence[Rollout], panels: Sequence[str]) -> list[str]:
    """Return the requested panels, or all that can be drawn for all runs."""
    tasks = all(run["singular_values"].size for run in runs)
    law = all(map(measures.has_law, runs))
    can = {
        "null_space": law,
        "decay": law,
        "field": law,
        "determinant": tasks and all(map(measures.rows_compare, runs)),
        "errors": tasks,
        "singular_values": tasks,
        "distances": all(map(measures.distances, runs)),
        "terms": all(len(log_series.field_terms(run)) > 1 for run in runs),
    }
    for name in panels:
        if name not in PANELS:
            near = f"{did_you_mean(name, PANELS)} (there are {listing(PANELS)})"
            raise PlotError(f"no panel {name!r}{near}")
        if not can.get(name, True):
            raise PlotError(
                f"the logs have no {name} to draw, or none that can be compared"
            )
    usual = [name for name in PANELS if name not in ("joints", "speeds")]
    return [*dict.fromkeys(panels)] or [name for name in usual if can.get(name, True)]


def _draw_together(
    axes: Axes, draw: Callable[[Axes, Rollout], None], runs: Sequence[Rollout]
) -> None:
    """Draw runs in one panel: one or two curves by colour, more of them by dashes."""
    spans, count = [], 0
    named: list[Artist] = []  # the first log's legend is used for all
    for number, run in enumerate(runs):
        known: set[Artist] = {*axes.lines, *axes.patches, *axes.collections}
        axes.autoscale(axis="y")
        draw(axes, run)
        spans.append((*axes.get_xlim(), *axes.get_ylim()))
        if len(runs) == 1:
            return
        drawn = (*axes.lines, *axes.patches, *axes.collections)
        fresh = [x for x in drawn if x not in known and _label(x)]
        if number:
            _shorten_labels(named, fresh)
        named = named or fresh
        lines = [line for line in axes.lines if line not in known]
        thick = [
            line
            for line in lines
            if line.get_linewidth() > _THIN and line.get_linestyle() != "None"
        ]
        count = count or len(thick)
        for line in lines:
            if count <= 2 and line.get_linewidth() > _REFERENCE:
                line.set(color=palette.run(number))
            if count != 2 and line in thick:
                line.set(linestyle=_LOG_DASHES[number % 4])
    left, right, low, high = zip(*spans, strict=True)
    axes.set_xlim(min(left), max(right))
    axes.set_ylim(min(low), max(high))
    curves.legend_below(axes)


def _label(artist: Artist) -> str:
    """Return an artist's label; empty if the legend leaves it out."""
    text = str(artist.get_label())
    return "" if text.startswith("_") else text


def _shorten_labels(named: Sequence[Artist], others: Sequence[Artist]) -> None:
    """Remove from labels the numbers that differ from another log's.

    The labels of the other log are removed.
    """
    for first, other in zip(named, others, strict=False):
        kind, comma, _ = _label(first).partition(", ")
        same = _label(first) == _label(other)
        if comma and not same and _label(other).partition(", ")[0] == kind:
            first.set_label(kind)
    for other in others:
        other.set_label("_")


_NAME_HANDLE, _NAME_PAD = 3.0, 0.5  # beside a log's name, over the font size


def _name_logs(figure: Figure, names: Sequence[str]) -> None:
    """Add a legend that names the logs, above the panels."""
    samples = [
        Line2D([], [], color=palette.run(k), linestyle=_LOG_DASHES[k % 4], label=name)
        for k, name in enumerate(map(curves.math_text, names))
    ]
    figure.legend(
        handles=samples,
        loc="outside upper left",
        ncols=curves.columns_within(
            figure.get_figwidth(), names, _NAME_HANDLE + _NAME_PAD
        ),
        handlelength=_NAME_HANDLE,
    )


def _letter_titles(
    axes: list[Axes], titles: list[str], pad: float | None = None
) -> None:
    y = None if pad is None else 1.0  # None: each title moves above its own ticks
    for letter, one, title in zip("abcdefghijkl", axes, titles, strict=False):
        one.set_title(f"({letter})  {title}", y=y, pad=pad)


def _add_title(figure: Figure, rollout: Rollout, title: str | None = None) -> None:
    """Add the title, and the facts of the run at the foot."""
    meta, config = rollout.meta, rollout.config or {}
    robot, field = meta["robot"]["name"], meta.get("field", "")
    named = (title, config.get("title"), meta.get("title"), meta.get("name"))
    shown = next(filter(None, named), f"{robot}, field: {field}")
    figure.suptitle(curves.literal_text(textwrap.fill(str(shown), 100)))
    version = meta.get("versions", {}).get("hsp_control", "")
    parts = [f"robot {robot}", f"field {field}", f"metric {meta.get('metric', '')}"]
    parts += [f"hsp_control {version}"] if version else []
    if rollout.status != "completed":
        parts.insert(0, f"{rollout.status}: {meta.get('message', '')}")
    figure.supxlabel(
        curves.literal_text(textwrap.fill("  ·  ".join(parts), 180)),
        fontsize=7.5,
        color=palette.MUTED if rollout.status == "completed" else palette.WARNING,
        x=0.01,
        ha="left",
    )


def _check(rollout: Rollout) -> None:
    if len(rollout) == 0:
        raise PlotError(f"the log has no rows to draw ({rollout.status})")


def differing(names: Sequence[str]) -> list[str]:
    """Return names without the settings that all of them begin with.

    ``panda-duration=4-gain=2`` and ``panda-duration=4-gain=8`` differ by ``gain=2`` and
    ``gain=8``.
    """
    words = [name.split("-") for name in names]
    shared = sum(accumulate((len({*w}) == 1 for w in zip(*words, strict=False)), min))
    return ["-".join(each[shared:] or each) for each in words]


_INCHES = {"mm": 1.0 / 25.4, "cm": 1.0 / 2.54, "in": 1.0}


def inches(width: str | float) -> float:
    """Return a width in inches: of a text such as ``84mm``, or in metres."""
    text = width if isinstance(width, str) else f"{1e3 * width}mm"
    try:
        found = float(text[:-2]) * _INCHES[text[-2:]]
    except (KeyError, ValueError):
        found = np.nan
    if not 1.0 <= found <= 100.0:
        raise PlotError(f"width is {width!r}; needs a length such as 84mm or 3.3in")
    return found


def save_figures(
    rollout: Rollout,
    folder: str | Path,
    stem: str,
    formats: Sequence[str] = ("png",),
    *,
    absolute: bool = True,
    width: str | float | None = None,
    times: Sequence[float] | None = None,
) -> list[Path]:
    """Write ``<stem>-paper`` and ``<stem>-diagnostics`` in every format."""
    paper = paper_figure(rollout, absolute=absolute, width=width, times=times)
    diagnostics = diagnostics_figure(rollout, width=width)
    return [
        *save_figure(paper, Path(folder) / f"{stem}-paper", formats),
        *save_figure(diagnostics, Path(folder) / f"{stem}-diagnostics", formats),
    ]


def save_for_a_column(
    figure: Figure, path: Path, metadata: dict[str, str] | None = None
) -> None:
    """Write a picture that has 300 dots per inch where it is printed 84 mm wide.

    A journal's column is that wide. In a figure of width w, text that is printed there
    at 6 pt has a size of 6 pt · w / 84 mm.
    """
    dots = 300.0 * 84.0 * _INCHES["mm"]
    figure.savefig(path, dpi=dots / figure.get_figwidth(), metadata=metadata)


def save_figure(figure: Figure, stem: Path, formats: Sequence[str]) -> list[Path]:
    """Write one figure in every format; return its files."""
    known = figure.canvas.get_supported_filetypes()
    paths = [stem.with_name(f"{stem.name}.{suffix}") for suffix in formats]
    for path, suffix in zip(paths, formats, strict=True):
        if suffix not in known:
            raise PlotError(
                f"no picture format {suffix!r}{did_you_mean(suffix, known)} "
                f"(there are {listing(known)})"
            )
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with styled():
                figure.savefig(path, format=suffix)
        except OSError as error:
            reason = error.strerror or str(error)
            raise PlotError(f"{path}: cannot write the picture: {reason}") from error
    return paths
