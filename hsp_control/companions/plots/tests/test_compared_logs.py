"""Several logs in the same panels, chosen panels, limits, and marked steps."""

from pathlib import Path

import numpy as np
import pytest
from drawn_logs import changed, drawn, legend_texts, planar, spatial

import hsp_control.companions.plots as plots
from hsp_control import Rollout
from hsp_control.cli import main
from hsp_control.common.errors import PlotError
from hsp_control.companions.plots import palette


@pytest.fixture(scope="module")
def log() -> Rollout:
    return planar(4)


@pytest.mark.slow
def test_logs_share_panels_and_a_legend_names_them(log: Rollout) -> None:
    half = changed(log, slice(50), {"tau": 2.0 * log.tau[:50]})
    figure = plots.diagnostics_figure(
        log,
        half,
        names=["mine", "mine,null_space.gain=20"],
        panels=["null_space", "efforts"],
    )
    errors, efforts = figure.axes
    actual = [each for each in errors.lines if len(each.get_xdata()) in (50, 101)]
    colors = {len(each.get_xdata()): each.get_color() for each in actual}
    assert colors == {101: palette.run(0), 50: palette.run(1)}
    first, second = (line for line in efforts.lines[::3])  # three joints per log
    assert first.get_color() == second.get_color()
    assert first.get_linestyle() != second.get_linestyle()
    assert efforts.get_xlim() == (0.0, log.t[-1])
    low, high = efforts.get_ylim()
    assert low <= 2.0 * log.tau[:50].min() < 2.0 * log.tau[:50].max() <= high
    assert legend_texts(efforts) == ["joint1", "joint2", "joint3"]
    (names,) = figure.legends
    shown = [each.get_text() for each in names.texts]
    assert shown == ["mine", "mine,null_space.gain=20"]


@pytest.mark.slow
def test_a_narrow_figure_names_all_its_logs(log: Rollout) -> None:
    """Within its width; predictions have one common entry in the legend."""
    logs = [log, *(changed(log, slice(None), {}) for _ in range(3))]
    logs[2].meta["null_space_gain"] = (3.0 * np.eye(3)).tolist()
    names = [f"$K_N = {k}$" for k in (4, 8, 16, 32)]
    figure = plots.diagnostics_figure(
        *logs, names=names, panels=["null_space"], width="84mm"
    )
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert legend.get_window_extent().x1 <= figure.bbox.x1
    assert "predicted: exp(−$K_N$ t)" in legend_texts(figure.axes[0])


@pytest.mark.slow
def test_a_figure_for_a_paper_has_its_width_and_chosen_panels(
    log: Rollout, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    for width in ("84mm", 0.084):
        figure = plots.diagnostics_figure(log, panels=["speeds", "errors"], width=width)
        assert figure.get_figwidth() == pytest.approx(84.0 / 25.4)
    assert figure._suptitle is figure._supxlabel is None
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    assert titles == ["(a)  Joint speeds", "(b)  Task error"]
    for wrong, why in (
        ({"panels": ["eror"]}, "no panel 'eror'; did you mean 'errors'"),
        ({"width": "84"}, "width is '84'; needs a length such as 84mm"),
        ({"width": 84.0}, "width is 84.0; needs"),
    ):
        with pytest.raises(PlotError, match=why):
            plots.diagnostics_figure(log, **wrong)
    with pytest.raises(PlotError, match="the logs have no distances to draw"):
        plots.diagnostics_figure(spatial()["pose"], panels=["distances"])
    files = [str(log.save(tmp_path / f"{name}.npz")) for name in ("a", "b")]
    assert main(["plot", *files, "--panels", "errors, field", "--width", "9cm"]) == 0
    assert (tmp_path / "a-b-errors-field.png").stat().st_size > 10_000


@pytest.mark.slow
def test_limits_that_joints_come_near_are_drawn_and_steps_are_marked(
    log: Rollout,
) -> None:
    most = np.abs(log.tau).max(axis=0)
    limits = {"effort": [most[0], 2.0 * most[1], None], "lower": [None] * 3}
    status = np.zeros(len(log))
    status[10:20] = 2.0
    bounded = np.zeros(len(log))
    bounded[30:] = 1.0
    marked = changed(
        log, columns={"status": status, "task.tip.bounded": bounded}, limits=limits
    )
    axes = drawn(plots.draw_efforts, marked)
    drawn_limits = [line for line in axes.lines if len(line.get_xdata()) == 2]
    assert {line.get_ydata()[0] for line in drawn_limits} <= {most[0], -most[0]}
    assert {line.get_color() for line in drawn_limits} == {palette.series(0)}
    texts = legend_texts(drawn(plots.draw_task_errors, marked))
    assert texts == ["tip [m]", "limited", "error bounded"]
    first, second = drawn(plots.draw_task_errors, marked).patches
    assert (first.get_x(), first.get_x() + first.get_width()) == pytest.approx(
        (log.t[10], log.t[20])
    )
    assert second.get_x() == log.t[30]


@pytest.mark.slow
def test_determinants_of_different_sizes_are_not_compared(log: Rollout) -> None:
    values = log["singular_values"].copy()
    values[:40, 1] = np.nan
    steps = changed(log, columns={"singular_values": values})
    paper, diagnostics = (
        [axes.get_title(loc="left") for axes in figure(steps).axes]
        for figure in (plots.paper_figure, plots.diagnostics_figure)
    )
    assert not [title for title in diagnostics if "Determinant" in title]
    assert "(c)  Singular values" in paper
    with pytest.raises(PlotError, match="the logs have no determinant to draw"):
        plots.diagnostics_figure(log, steps, panels=["determinant"])
