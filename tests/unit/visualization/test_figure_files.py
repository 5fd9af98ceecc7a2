"""Check figures of short logs, their files, and what drawing leaves behind."""

import itertools
import subprocess
import sys
from pathlib import Path

import matplotlib as mpl
import numpy as np
import pytest
from drawn_logs import PAPER, both, changed, drawn, planar, spatial, visible
from matplotlib.backends.backend_agg import FigureCanvasAgg

import hsp_control.visualization.plots as plots
from hsp_control import Rollout
from hsp_control.common.exceptions import PlotError
from hsp_control.visualization import palette
from hsp_control.visualization.plots import (
    paths,
    views,
)

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def logs() -> dict[str, Rollout]:
    return {name: planar(number) for name, number in PAPER.items()} | spatial()


# --- logs at the edge ----------------------------------------------------------------


@pytest.mark.parametrize("name", ["obstacle", "several", "posture"])
def test_one_row_is_drawn(logs: dict[str, Rollout], name: str) -> None:
    short = changed(logs[name], slice(1), status="interrupted", message="by the user")
    for figure in both(short):
        figure.canvas.draw()
        assert figure.get_supxlabel().startswith("interrupted: by the user")


def test_a_log_without_rows_says_so(logs: dict[str, Rollout]) -> None:
    empty = changed(logs["rest"], slice(0), status="diverged")
    for draw in (plots.paper_figure, plots.diagnostics_figure):
        with pytest.raises(PlotError, match=r"no rows to draw \(diverged\)"):
            draw(empty)
    with pytest.raises(PlotError, match="needs at least 1"):
        plots.paper_figure(logs["rest"], times=[])


def test_a_robot_that_stands_still_is_drawn(logs: dict[str, Rollout]) -> None:
    for name in ("rest", "posture"):
        rows = np.zeros(30, dtype=int)
        still = {
            k: column[rows] for k, column in logs[name].columns.items() if k != "t"
        }
        log = changed(logs[name], slice(30), still)
        for figure in both(log):
            figure.canvas.draw()
        axes = drawn(plots.draw_end_effector, log)
        assert np.ptp(axes.get_xlim()) > 0.01  # rounding is not magnified


@pytest.mark.parametrize("count", [1, 3, 8, 13])
def test_any_number_of_frames_fits(logs: dict[str, Rollout], count: int) -> None:
    figure = plots.paper_figure(logs["obstacle"], frames=count)
    titles = [axes.get_title(loc="left") for axes in visible(figure)]
    assert sum("t = " in title for title in titles) == count


def test_a_box_has_two_numbers_on_every_edge() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        lower = rng.uniform(-1.0, 1.0, 3)
        upper = lower + rng.uniform(0.05, 1.0, 3)
        axes = drawn(paths.draw_box, views.oblique(), lower, upper)
        numbers = [text for text in axes.texts if "[" not in text.get_text()]
        assert len(numbers) >= 6
        assert paths.corners(lower, upper).shape == (8, 3)


# --- files, and what drawing leaves behind -------------------------------------------


@pytest.mark.system
def test_figures_are_written_in_every_format(
    logs: dict[str, Rollout], tmp_path: Path
) -> None:
    log, folder = changed(logs["rest"], slice(20)), tmp_path / "new" / "folder"
    files = plots.save_figures(log, folder, "run", ("pdf", "svg"))
    kinds = itertools.product(("paper", "diagnostics"), ("pdf", "svg"))
    assert files == [folder / f"run-{name}.{suffix}" for name, suffix in kinds]
    assert all(5_000 < file.stat().st_size < 500_000 for file in files)


def test_what_cannot_be_written_says_why(
    logs: dict[str, Rollout], tmp_path: Path
) -> None:
    with pytest.raises(PlotError, match="no picture format 'pgn'; did you mean 'png'"):
        plots.save_figures(logs["rest"], tmp_path, "run", ("pgn",))
    (tmp_path / "file").touch()
    with pytest.raises(PlotError, match=r"run-paper\.png: cannot write the picture"):
        plots.save_figures(logs["rest"], tmp_path / "file", "run")


def test_parameters_of_matplotlib_are_left_alone(logs: dict[str, Rollout]) -> None:
    before = dict(mpl.rcParams)
    figure = plots.diagnostics_figure(changed(logs["space"], slice(3)))
    assert isinstance(figure.canvas, FigureCanvasAgg)
    figure.canvas.draw()
    assert dict(mpl.rcParams) == before


def test_a_figure_keeps_its_style_wherever_it_is_saved(tmp_path: Path) -> None:
    with plots.styled():
        figure = plots.new_figure(2.0, 2.0)
        axes = figure.add_subplot()
        axes.plot([0.0, 1.0], [0.0, 1.0])
    figure.savefig(tmp_path / "plain.png")  # outside the style
    label = axes.xaxis.get_major_ticks()[0].label1
    assert label.get_fontsize() == 8.0
    assert label.get_color() == palette.INK


@pytest.mark.system
@pytest.mark.process
def test_matplotlib_comes_late_and_no_display_is_needed(tmp_path: Path) -> None:
    program = """
import sys
import hsp_control
assert not [name for name in sys.modules if name.startswith("matplotlib")]
from hsp_control.visualization.plots import new_figure, styled
with styled():
    new_figure(1.0, 1.0).add_subplot()
assert "matplotlib.pyplot" not in sys.modules
"""
    environment = {"MPLBACKEND": "TkAgg", "HOME": str(tmp_path), "PATH": ""}
    subprocess.run([sys.executable, "-c", program], check=True, env=environment)


def test_a_figure_shows_itself_in_a_notebook(logs: dict[str, Rollout]) -> None:
    picture = plots.paper_figure(logs["rest"])._repr_png_()
    assert picture.startswith(b"\x89PNG")
    assert len(picture) < 300_000


def test_the_style_can_be_had_for_good() -> None:
    with mpl.rc_context():
        plots.use_style()
        assert mpl.rcParams["axes.titleweight"] == "bold"
        assert mpl.rcParams["axes.prop_cycle"].by_key()["color"] == list(palette.SERIES)
    assert mpl.rcParams["axes.titleweight"] != "bold"
