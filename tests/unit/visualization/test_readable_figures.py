"""Check that figures can be read: labels, legends, overlaps, numbers, headings."""

import itertools

import pytest
from drawn_logs import (
    PAPER,
    both,
    legend_texts,
    planar,
    spatial,
    visible,
)
from matplotlib.figure import Figure, SubFigure

from hsp_control import Rollout

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
