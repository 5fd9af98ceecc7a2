"""Figures: short logs, files, and legibility."""

import itertools
import subprocess
import sys
from pathlib import Path

import pytest
from drawn_logs import PAPER, both, changed, legend_texts, planar, visible
from matplotlib.figure import Figure, SubFigure
from places import further

import hsp_control.companions.plots as plots
from hsp_control import Rollout
from hsp_control.cli import main
from hsp_control.common.errors import PlotError

# --- short logs ----------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("name", ["several", *further("obstacle", "posture")])
def test_one_row_is_drawn(logs: dict[str, Rollout], name: str) -> None:
    short = changed(logs[name], slice(1), status="interrupted", message="by the user")
    for figure in both(short):
        figure.canvas.draw()
        assert figure.get_supxlabel().startswith("interrupted: by the user")


@pytest.mark.slow
def test_a_log_without_rows_is_refused() -> None:
    whole = planar(PAPER["rest"])
    empty = changed(whole, slice(0), status="diverged")
    for draw in (plots.paper_figure, plots.diagnostics_figure):
        with pytest.raises(PlotError, match=r"no rows to draw \(diverged\)"):
            draw(empty)
    with pytest.raises(PlotError, match="needs at least 1"):
        plots.paper_figure(whole, times=[])


# --- files, and side effects of drawing ----------------------------------------------


@pytest.mark.slow
@pytest.mark.system
def test_figures_are_written_in_every_format(tmp_path: Path) -> None:
    log, folder = changed(planar(PAPER["rest"]), slice(20)), tmp_path / "new" / "folder"
    formats = "svg", *further("pdf")  # written by an example
    files = plots.save_figures(log, folder, "run", formats)
    kinds = itertools.product(("paper", "diagnostics"), formats)
    assert files == [folder / f"run-{name}.{suffix}" for name, suffix in kinds]
    assert all(5_000 < file.stat().st_size < 500_000 for file in files)


@pytest.mark.slow
def test_an_unwritable_file_gives_the_reason(tmp_path: Path) -> None:
    log = planar(PAPER["rest"])
    with pytest.raises(PlotError, match="no picture format 'pgn'; did you mean 'png'"):
        plots.save_figures(log, tmp_path, "run", ("pgn",))
    (tmp_path / "file").touch()
    with pytest.raises(PlotError, match=r"run-paper\.png: cannot write the picture"):
        plots.save_figures(log, tmp_path / "file", "run")


@pytest.mark.slow
def test_plot_draws_beside_a_log_and_names_files_that_are_none(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    log = planar(4).save(tmp_path / "run.npz")
    assert main(["plot", str(log)]) == 0
    printed = capsys.readouterr().out
    for figure in ("run-paper.png", "run-diagnostics.png"):
        assert f"Figure: {tmp_path / figure}" in printed
        assert (tmp_path / figure).stat().st_size > 10_000
    for name, message in (
        ("nowhere.npz", "hsp: nowhere.npz: no such file"),
        (__file__, "not a complete .npz log"),
        ("mine.yaml", "not a log; hsp run mine.yaml writes one"),
    ):
        assert main(["plot", name]) == 2
        assert message in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.system
@pytest.mark.process
def test_matplotlib_comes_late_and_no_display_is_needed(tmp_path: Path) -> None:
    program = """
import sys
import hsp_control
assert not [name for name in sys.modules if name.startswith("matplotlib")]
from hsp_control.companions.plots import new_figure, styled
with styled():
    new_figure(1.0, 1.0).add_subplot()
assert "matplotlib.pyplot" not in sys.modules
"""
    environment = {"MPLBACKEND": "TkAgg", "HOME": str(tmp_path), "PATH": ""}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)


@pytest.mark.slow
def test_a_figure_shows_itself_in_a_notebook() -> None:
    picture = plots.paper_figure(planar(PAPER["rest"]))._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) < 300_000


SHOWN = ("equal", "several", *further("posture", "obstacle", "space"))


@pytest.fixture(scope="module")
def drawings(logs: dict[str, Rollout]) -> dict[str, list[Figure]]:
    """Return both figures of every log, drawn."""
    figures = {name: both(logs[name]) for name in SHOWN}
    for figure in itertools.chain(*figures.values()):
        figure.canvas.draw()
    return figures


@pytest.fixture(params=SHOWN)
def shown(
    drawings: dict[str, list[Figure]], request: pytest.FixtureRequest
) -> list[Figure]:
    return drawings[request.param]


@pytest.mark.slow
def test_axes_have_labels_with_units(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            if not axes.axison or axes.get_label() == "<colorbar>":
                continue
            for axis in (axes.xaxis, axes.yaxis):
                shown = any(
                    tick.label1.get_visible() for tick in axis.get_major_ticks()
                )
                text = axis.label.get_text()
                assert not shown or ("[" in text and text.endswith("]")), text


@pytest.mark.slow
def test_several_lines_have_a_legend(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            handles, labels = axes.get_legend_handles_labels()
            assert len(handles) < 2 or legend_texts(axes) == labels
            assert len(set(labels)) == len(labels)


@pytest.mark.slow
def test_nothing_is_clipped_and_nothing_overlaps(shown: list[Figure]) -> None:
    for figure in shown:
        renderer = figure.canvas.get_renderer()
        paper = figure.bbox.padded(1.0)
        panels = [
            (axes, axes.get_tightbbox(renderer))
            for axes in visible(figure)
            if axes.axison or axes.lines
        ]
        headings = [
            (text, text.get_window_extent(renderer))
            for owner in (figure, *figure.findobj(SubFigure))
            for text in (owner._suptitle, owner._supxlabel)
            if text is not None
        ]
        for what, place in panels + headings:
            inside = paper.contains(place.x0, place.y0), paper.contains(*place.max)
            assert inside == (True, True), what
        for (one, here), (other, there) in itertools.combinations(panels + headings, 2):
            if one in getattr(other, "child_axes", []):
                continue  # the time axis is in its panel
            overlap = here.intersection(here, there)
            assert overlap is None or min(overlap.size) < 3.0, (one, other)
