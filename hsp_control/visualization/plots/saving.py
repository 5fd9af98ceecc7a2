"""Writes figures to files."""

from collections.abc import Sequence
from pathlib import Path

from matplotlib.figure import Figure

from hsp_control.common.exceptions import PlotError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.simulation import Rollout
from hsp_control.visualization.plots.figures import diagnostics_figure, paper_figure
from hsp_control.visualization.plots.style import styled


def save_figures(
    rollout: Rollout,
    folder: str | Path,
    stem: str,
    formats: Sequence[str] = ("png",),
    *,
    absolute: bool = True,
) -> list[Path]:
    """Write ``<stem>-paper`` and ``<stem>-diagnostics`` in every format."""
    figures = {
        "paper": paper_figure(rollout, absolute=absolute),
        "diagnostics": diagnostics_figure(rollout),
    }
    paths = []
    for name, figure in figures.items():
        for suffix in formats:
            path = Path(folder) / f"{stem}-{name}.{suffix}"
            save_figure(figure, path, suffix)
            paths.append(path)
    return paths


def save_figure(figure: Figure, path: Path, suffix: str) -> None:
    """Write one figure in one format."""
    known = figure.canvas.get_supported_filetypes()
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
