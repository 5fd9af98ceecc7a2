"""When a page opens, and what it says before all is ready."""

from argparse import Namespace
from collections.abc import Callable

import pytest

from hsp_control.cli.pages import OpeningPage, draw_before
from hsp_control.common import adapters, kernels
from hsp_control.common.exceptions import SimulationError
from hsp_control.config.loaded_scenario import load_scenario
from hsp_control.config.source import read_document
from hsp_control.visualization.viewer import SceneRecorder, Viewer, transport
from hsp_control.visualization.viewer.commands import unpack


class Said:
    """A page that keeps what happened."""

    def __init__(self) -> None:
        self.events: list[str] = []
        options = Namespace(browser=True)
        self.page = OpeningPage(
            "http://x/", options, self.events.append, self.events.append
        )


@pytest.fixture
def said(monkeypatch: pytest.MonkeyPatch) -> Said:
    said = Said()

    def open_browser(url: str) -> bool:
        said.events.append("browser")
        return True

    monkeypatch.setattr(transport, "open_browser", open_browser)
    return said


def compiled() -> None:
    kernels._watched(lambda: None)


def transforms(recorder: SceneRecorder) -> dict[str, bytes]:
    return {path: packed for path, kind, packed in recorder.scene.items()
            if kind == "transform"}  # fmt: skip


def test_it_opens_at_the_first_kernel_and_says_how_many(said: Said) -> None:
    with said.page.compiling():
        assert not said.page.opened
        compiled()
        compiled()
    said.page.ready()
    line = "Compiling kernels (once, 10 to 20 s) ... {} done"
    assert said.events == [
        line.format(0), "http://x/", "browser", *map(line.format, (1, 1, 2)), "",
    ]  # fmt: skip
    assert said.page.opened


def fail_at_last(page: OpeningPage, *events: Callable[[], object]) -> None:
    with page.compiling():
        for event in events:
            event()
        raise SimulationError("why")


def test_an_open_page_says_why_the_rest_failed(said: Said) -> None:
    with pytest.raises(SimulationError):
        fail_at_last(said.page)
    assert said.events == []  # no page was opened
    with pytest.raises(SimulationError):
        fail_at_last(said.page, compiled)
    assert said.events[-1] == "why"


def test_the_robot_is_drawn_at_its_start_before_any_kernel_is_compiled(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def compile_none(*_: object) -> int:
        raise AssertionError("a kernel was asked for")

    monkeypatch.setattr(adapters, "adapter", compile_none)
    document = read_document("panda_obstacle")
    document.override("start={joints: {panda_joint4: -1.0}}")
    loaded = load_scenario(document)
    recorder = SceneRecorder()
    viewer = Viewer(loaded.robot, transport=recorder)
    draw_before(viewer, loaded)
    captions = [unpack(packed)["title"] for _, kind, packed in recorder.scene.items()
                if kind == "caption"]  # fmt: skip
    assert captions == [loaded.scenario.title]
    drawn = transforms(recorder)
    viewer.show(loaded.robot.home())
    home = transforms(recorder)
    moved = {path for path in drawn if drawn[path] != home[path]}
    assert "/robot/panda_joint5" in moved
    assert "/robot/panda_joint3" not in moved
