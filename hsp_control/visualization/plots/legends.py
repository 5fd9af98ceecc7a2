"""Legends below the axes, where they cover nothing, and notes in them."""

from collections.abc import Sequence

from matplotlib.axes import Axes
from matplotlib.transforms import ScaledTranslation

_HANDLE, _GAP, _LETTER = 2.2, 1.3, 0.55
"""Widths in a legend over its font size: handle, gap of columns, mean letter."""


def legend_below(axes: Axes) -> None:
    """Add a legend of all labelled artists, if there are any, below the axes."""
    handles, labels = axes.get_legend_handles_labels()
    if not handles:
        return
    figure = axes.get_figure(root=False)
    drop = (
        32.0 if axes.axison else 22.0
    )  # height of the tick labels below the axes [pt]
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
