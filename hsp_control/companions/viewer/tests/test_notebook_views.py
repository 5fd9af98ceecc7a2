"""Views in a notebook, in a real browser: no server, no network, no kernel.

Chromium without a window; where there is none these tests are skipped, but not in CI.
"""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from browsers import HARMLESS, until

import hsp_control as hsp
from hsp_control import Rollout, load_experiment
from hsp_control.companions.viewer import Viewer
from hsp_control.config.experiment import Experiment

JOINT = "/robot/joint1"


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    return load_experiment("paper/4_moving_obstacle", "simulation.duration=2")


@pytest.fixture(scope="module")
def rollout(experiment: Experiment) -> Rollout:
    return experiment.run()


class Notebook:
    """A page with the outputs of cells, like a notebook's."""

    def __init__(self, browser: Any, folder: Path, *outputs: str) -> None:
        file = folder / "notebook.html"
        file.write_text(
            "<!DOCTYPE html><meta charset=utf-8><body><p>A notebook</p>"
            + "".join(f"<div>{output}</div>" for output in outputs),
            encoding="utf-8",
        )
        self.page = browser.new_page(viewport={"width": 900, "height": 700})
        self.wrong: list[str] = []
        self.requests: list[str] = []
        self.page.on("console", self._on_console)
        self.page.on("pageerror", lambda error: self.wrong.append(str(error)))
        self.page.on("request", lambda request: self.requests.append(request.url))
        self.page.goto(file.as_uri())
        self.views = self.page.frames[1:]
        for view in self.views:
            until(view, "document.body.dataset.ready === 'yes'")
            view.evaluate("drawLightly()")

    def _on_console(self, message: Any) -> None:
        if message.type in {"error", "warning"} and HARMLESS not in message.text:
            self.wrong.append(message.text)

    def close(self) -> None:
        self.page.close()
        assert self.wrong == []
        # The frames contain their content.
        assert all(
            url.startswith(("file:", "about:", "data:")) for url in self.requests
        )


def turn(view: Any) -> float:
    """Return the first joint's rotation about its axis [rad]."""
    _, _, z, w = view.evaluate(f"node('{JOINT}').quaternion.toArray()")
    return float(2.0 * np.arctan2(z, w))


def logged(rollout: Rollout, moment: float) -> float:
    return float(np.interp(moment, rollout.t, rollout["joint_positions"][:, 0]))


@pytest.mark.browser
def test_a_viewer_is_shown_after_its_server_has_ended(
    browser: Any, tmp_path: Path, experiment: Experiment, rollout: Rollout
) -> None:
    with Viewer(experiment.robot) as viewer:
        viewer.draw_scene(rollout, controller=experiment.controller)
        shown = viewer._repr_html_()
    assert viewer._repr_html_() == shown  # also now
    assert len(shown) < 600_000
    notebook = Notebook(browser, tmp_path, shown)
    (view,) = notebook.views
    slider = view.locator(".timeline")
    box = slider.bounding_box()
    for share in (0.25, 0.75):
        notebook.page.mouse.click(
            box["x"] + share * box["width"], box["y"] + box["height"] / 2
        )
        moment = view.evaluate("player.time")
        assert moment == pytest.approx(2.0 * share, abs=0.05)
        assert turn(view) == pytest.approx(logged(rollout, moment), abs=2e-3)
    # After a click it receives keys.
    notebook.page.keyboard.press("Home")
    assert view.evaluate("[player.time, player.playing]") == [0, False]
    notebook.page.keyboard.press(" ")
    until(view, "player.time > 0.02")
    # Its content cannot access the notebook.
    assert view.evaluate("window.origin") == "null"
    notebook.close()


@pytest.mark.browser
def test_runs_are_shown_without_any_server(
    browser: Any, tmp_path: Path, experiment: Experiment, rollout: Rollout
) -> None:
    first = hsp.viewer.show(rollout, controller=experiment.controller, speed=0.5)
    second = hsp.viewer.show(
        rollout, robot=experiment.robot, height=300, background="#14202B"
    )
    assert repr(first).startswith("InlineView(0.")
    assert f"{first.size / 1e6:.1f} MB in this notebook" in first._repr_html_()
    assert "127.0.0.1" not in first._repr_html_()
    notebook = Notebook(browser, tmp_path, *(v._repr_html_() for v in (first, second)))
    one, other = notebook.views
    assert one.evaluate("[player.speed, player.playing]") == [0.5, False]
    one.evaluate("player.seek(1.5)")
    assert turn(one) == pytest.approx(logged(rollout, 1.5), abs=2e-3)
    assert turn(other) == pytest.approx(logged(rollout, 0.0), abs=2e-3)
    assert one.locator("#side").is_hidden()
    assert one.locator(".player .side").is_hidden()
    assert other.evaluate("innerHeight") == 300
    assert other.evaluate("document.body.classList.contains('dark')")
    notebook.close()
