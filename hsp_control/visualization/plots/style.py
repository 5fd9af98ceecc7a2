"""The style of figures, as a context, and empty figures with that style.

No display is needed: figures have an Agg canvas, and pyplot is not imported.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from io import BytesIO
from typing import Any

import matplotlib as mpl
from cycler import cycler
from matplotlib.backend_bases import RendererBase
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from hsp_control.visualization import palette

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
    "legend.fontsize": 8.0,
    "legend.frameon": False,
    "legend.handlelength": 1.7,
    "legend.handletextpad": 0.5,
    "legend.labelspacing": 0.35,
    "lines.linewidth": 1.4,
    "lines.solid_capstyle": "round",
    "mathtext.default": "regular",
    "mathtext.fontset": "dejavusans",
    "pdf.fonttype": 42,  # TrueType, which journals ask for
    "savefig.dpi": 160,
    "text.color": palette.INK,
    "xtick.color": palette.MUTED,
    "xtick.labelcolor": palette.INK,
    "xtick.labelsize": 8.0,
    "xtick.major.size": 3.0,
    "xtick.minor.size": 1.5,
    "ytick.color": palette.MUTED,
    "ytick.labelcolor": palette.INK,
    "ytick.labelsize": 8.0,
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
    """A figure that is drawn in the style outside of `styled` too: ticks come late."""

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
