"""Check that figures can be read: labels, legends, overlaps, numbers, headings."""

import itertools

import numpy as np
import pytest
from drawn_logs import (
    PAPER,
    both,
    changed,
    drawn,
    legend_texts,
    lines,
    planar,
    spatial,
    visible,
)
from matplotlib.figure import Figure, SubFigure

import hsp_control.visualization.plots as plots
from hsp_control import Rollout
from hsp_control.simulation import log_series

pytestmark = pytest.mark.slow


@pytest.fixture(scope="module")
def logs() -> dict[str, Rollout]:
    return {name: planar(number) for name, number in PAPER.items()} | spatial()


SHOWN = ("equal", "obstacle", "space", "several", "posture")


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


def test_several_lines_have_a_legend(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            handles, labels = axes.get_legend_handles_labels()
            assert len(handles) < 2 or legend_texts(axes) == labels
            assert len(set(labels)) == len(labels)


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
                continue  # the scale of time stands in its panel
            overlap = here.intersection(here, there)
            assert overlap is None or min(overlap.size) < 3.0, (one, other)


def test_legends_hide_nothing(shown: list[Figure]) -> None:
    for figure in shown:
        renderer = figure.canvas.get_renderer()
        for axes in visible(figure):
            if axes.get_legend() is None:
                continue
            legend = axes.get_legend().get_window_extent(renderer)
            around = [text.get_window_extent(renderer) for text in axes.texts]
            if axes.axison:
                around += [axes.bbox, axes.xaxis.get_tightbbox(renderer)]
            assert not any(legend.overlaps(other) for other in around), axes


def test_numbers_on_axes_do_not_collide(shown: list[Figure]) -> None:
    for figure in shown:
        for axes in visible(figure):
            if not axes.axison:
                continue
            for axis in (axes.xaxis, axes.yaxis):
                low, high = sorted(axis.get_view_interval())
                labels = [
                    tick.label1.get_window_extent()
                    for tick in axis.get_major_ticks()
                    if low <= tick.get_loc() <= high and tick.label1.get_visible()
                ]
                for one, other in itertools.combinations(labels, 2):
                    assert not one.overlaps(other), axis.label.get_text()


def test_of_many_joints_the_busiest_are_named(logs: dict[str, Rollout]) -> None:
    n = 30
    names = [f"leg_{k}_joint" for k in range(n)]
    waves = np.sin(logs["rest"].t)[:, None] * np.arange(n)
    own = {"dofs": names, "units": ["rad"] * n, "nq": n, "nv": n}
    robot = logs["rest"].meta["robot"] | own
    log = changed(logs["rest"], columns={"tau": waves}, robot=robot)
    axes = drawn(plots.draw_efforts, log)
    busiest = [f"{k}_joint" for k in range(23, 30)]
    shown = [text.removeprefix("leg_") for text in legend_texts(axes)]
    assert shown == [*busiest, "23 others (grey)"]
    found = {tuple(y) for _, y in lines(axes) if len(y)}
    assert found == {tuple(waves[:, k]) for k in range(n)}


def test_a_bounded_law_is_marked(logs: dict[str, Rollout]) -> None:
    damped = np.zeros(101)
    damped[20:31] = damped[90:] = 1.0
    log = changed(logs["rest"], columns={"damped": damped})
    for draw in (
        plots.draw_manipulability,
        plots.draw_singular_values,
        plots.draw_task_errors,
        plots.draw_null_space_error,
    ):
        axes = drawn(draw, log)
        spans = [(patch.get_x(), patch.get_width()) for patch in axes.patches]
        np.testing.assert_allclose(spans, [(0.2, 0.1), (0.9, 0.1)], atol=1e-12)
        assert "damped near a singularity" in legend_texts(axes)


def test_names_are_shown_as_they_are(logs: dict[str, Rollout]) -> None:
    robot = logs["rest"].meta["robot"] | {"dofs": ["_a", "b$x$", "$c_"]}
    log = changed(
        logs["rest"], robot=robot, field="$g$", config={"title": "costs $5 and $6"}
    )
    assert legend_texts(drawn(plots.draw_efforts, log)) == [" _a", r"b\$x\$", r"\$c_"]
    figure = plots.diagnostics_figure(log)
    assert figure.get_suptitle() == r"costs \$5 and \$6"
    figure.canvas.draw()


def test_joints_lose_what_all_names_begin_with(logs: dict[str, Rollout]) -> None:
    assert log_series.joint_names(logs["pose"]) == [f"joint{k}" for k in range(1, 8)]
    for names, short in (
        (["lbr_a_1", "lbr_a_2"], ["a_1", "a_2"]),
        (["j1", "j2"], ["j1", "j2"]),
        (["only_one"], ["one"]),
    ):
        robot = {"dofs": names}
        found = log_series.joint_names(changed(logs["rest"], robot=robot))
        assert found in (short, names)
        assert all(name[0].isalpha() for name in found)


def test_the_title_is_the_configurations(logs: dict[str, Rollout]) -> None:
    title = "Simulation 2: rest, and its drift"
    log = logs["rest"]
    for figure in both(changed(log, config={"title": title})):
        assert figure.get_suptitle() == title
    bare = changed(log, config=None, title="", name=None)
    assert plots.paper_figure(bare).get_suptitle() == "planar3r, field: rest"


def test_frames_bear_one_number_in_every_panel(logs: dict[str, Rollout]) -> None:
    """A frame is found again by its number: in the strip, together, and over time."""
    log, times = logs["obstacle"], [0.2, 0.5, 0.9]
    figure = plots.paper_figure(log, times=times, title="With $ in it")
    assert figure.get_suptitle() == r"With \$ in it"
    figure.canvas.draw()
    titles = [axes.get_title(loc="left") for axes in figure.axes]
    strip = [title for title in titles if "t = " in title]
    numbered = zip((1, 2, 3), times, strict=True)
    assert strip == [rf"$\mathbf{{{k}}}$   t = {time:.2f} s" for k, time in numbered]
    (together,) = (a for a in figure.axes if len(a.texts) == len(times))
    for number, (text, time) in enumerate(zip(together.texts, times, strict=True), 1):
        assert text.get_text() == str(number)
        row = int(np.abs(log.t - time).argmin())
        assert text.xy == pytest.approx(log["skeleton"][row, -1, :2])
    for panel in ("(b)", "(c)"):
        (axes,) = (a for a in figure.axes if a.get_title(loc="left").startswith(panel))
        (upper,) = axes.child_axes
        np.testing.assert_allclose(upper.get_xticks(), times)
        assert [t.get_text() for t in upper.get_xticklabels()] == ["1", "2", "3"]


def test_frames_that_end_at_one_place_share_their_numbers(
    logs: dict[str, Rollout],
) -> None:
    skeleton = logs["rest"]["skeleton"].copy()
    skeleton[:, -1] = [1.0, 0.0, 0.0]
    skeleton[30, -1] = [1.0, 1.0, 0.0]
    log = changed(logs["rest"], columns={"skeleton": skeleton})
    axes = drawn(plots.draw_superimposed, log, [0, 10, 20, 30, 40])
    assert [text.get_text() for text in axes.texts] == ["1–3, 5", "4"]


def test_many_frames_are_marked_but_not_named(logs: dict[str, Rollout]) -> None:
    axes = drawn(plots.draw_manipulability, logs["rest"])
    plots.lines.mark_frames(axes, np.linspace(0.0, 1.0, 15))
    labels = [t.get_text() for t in axes.child_axes[0].get_xticklabels()]
    assert labels == [""] * 15


def test_a_frame_at_its_parent_is_numbered_above_it(logs: dict[str, Rollout]) -> None:
    """A hand whose frame lies on the last joint has no link to go on along."""
    skeleton = logs["rest"]["skeleton"].copy()
    skeleton[:, -1] = skeleton[:, -2]
    log = changed(logs["rest"], columns={"skeleton": skeleton})
    axes = drawn(plots.draw_superimposed, log, [0])
    assert axes.texts[0].xyann == pytest.approx((0.0, 8.0))
