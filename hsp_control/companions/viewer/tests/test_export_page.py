"""The plots of an exported page and its switch between runs, in a real browser."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import browsers
import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.companions.viewer import ComparedRun, export_html

pytest.importorskip("playwright.sync_api")

PLANAR = "paper/4_moving_obstacle"
JOINTS = 3  # the place of the plot of joint positions


@pytest.fixture(scope="module")
def page_file(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page of two runs of 4 s, with held efforts."""
    runs = []
    for name, weight in (("with", 1.0), ("without", 0.0)):
        experiment = load_experiment(
            PLANAR,
            "simulation.duration=4",
            "simulation.control_period=0.002",
            f"null_space.fields.1.weight={weight}",
        )
        run = experiment.run()
        runs.append(ComparedRun(name, experiment.robot, run, experiment.controller))
    return export_html(runs, tmp_path_factory.mktemp("page") / "two.html")


@pytest.fixture(scope="module")
def opened(browser: Any, page_file: Path) -> Iterator[tuple[Any, list[str]]]:
    """The page and the errors of its console: to open it takes seconds of CPU."""
    page, wrong = browsers.exported(browser, page_file, 1.0, (1280, 800))
    yield page, wrong
    page.close()


@pytest.fixture
def page(opened: tuple[Any, list[str]]) -> Iterator[Any]:
    """The page as it opens: both runs at 1 s, nothing zoomed, pointed at or focused."""
    page, wrong = opened
    page.mouse.move(200, 200)
    page.locator(".run-switch button").last.click()
    page.evaluate("document.activeElement.blur(); player.pause(); player.seek(1)")
    page.keyboard.press("Escape")
    yield page
    assert wrong == []


def place(page: Any, plot: int, moment: float) -> tuple[float, float]:
    """The screen position of a time, in a plot of the whole run."""
    over = page.locator("#side .u-over").nth(plot)
    over.scroll_into_view_if_needed()
    box = over.bounding_box()
    return box["x"] + moment / 4.0 * box["width"], box["y"] + 50


def drag(page: Any, plot: int, start: float, end: float) -> None:
    (x0, y), (x1, _) = place(page, plot, start), place(page, plot, end)
    page.mouse.move(x0, y)
    page.mouse.down()
    page.mouse.move(x1, y, steps=5)
    page.mouse.up()


def span(page: Any, plot: int) -> list[float]:
    """The first and the last time in a plot."""
    scale = "(k) => uPlot.sync('run').plots[k].scales.x"
    shown = page.evaluate(scale, plot)
    return [round(shown[end], 2) for end in ("min", "max")]


def zoom_label(page: Any) -> str | None:
    label = page.locator(".whole-run")
    return label.inner_text().split("✕")[0].strip() if label.is_visible() else None


def outputs(page: Any, plot: int) -> list[str]:
    return page.locator("#side section").nth(plot).locator("output").all_inner_texts()


def numbers(texts: list[str]) -> list[float]:
    return [
        float(number.replace("−", "-"))
        for text in texts
        for number in text.split(" | ")
    ]


@pytest.mark.browser
def test_the_pointer_shows_values_in_all_plots_and_leaves_the_time(page: Any) -> None:
    before = outputs(page, JOINTS)
    page.mouse.move(*place(page, JOINTS, 3.0))
    section = page.locator("#side section").nth(JOINTS)
    assert section.locator("time").inner_text() == "t = 3.00 s"
    shown = page.locator("#side .u-cursor-x:not(.u-off)")
    assert shown.count() == page.locator("#side .plot").count()
    hovered = outputs(page, JOINTS)
    assert hovered != before
    assert all(len(text.split(" | ")) == 2 for text in hovered)  # of both runs
    assert page.evaluate("player.time") == 1
    page.mouse.move(200, 200)
    assert outputs(page, JOINTS) == before
    assert shown.count() == 0
    page.mouse.click(*place(page, JOINTS, 3.0))
    assert page.evaluate("player.time") == pytest.approx(3.0, abs=0.02)
    page.mouse.move(200, 200)
    assert numbers(outputs(page, JOINTS)) == pytest.approx(numbers(hovered), abs=0.02)


@pytest.mark.browser
def test_a_finger_taps_a_time_and_leaves_no_pointer(
    browser: Any, page_file: Path
) -> None:
    page = browser.new_page(
        viewport={"width": 390, "height": 844}, is_mobile=True, has_touch=True
    )
    page.goto(browsers.light(f"{page_file.resolve().as_uri()}#t=1"))
    page.wait_for_selector("body[data-ready]", state="attached")
    page.touchscreen.tap(*place(page, 1, 3.0))
    browsers.until(page, "Math.abs(player.time - 3) < 0.03")
    assert page.locator("#side .u-cursor-x:not(.u-off)").count() == 0
    page.close()


@pytest.mark.browser
def test_all_plots_zoom_together_and_back(page: Any) -> None:
    first = span(page, 0)
    drag(page, JOINTS, 2.0, 3.0)
    assert page.evaluate("player.time") == 1  # a drag is no click
    assert zoom_label(page) == "2.00 – 3.00 s"
    assert span(page, 0) == span(page, JOINTS)
    assert span(page, 0) == pytest.approx([2.0, 3.0], abs=0.02)
    assert page.locator("#side .cursor:visible").count() == 0
    page.keyboard.press("Escape")
    assert zoom_label(page) is None
    assert span(page, 0) == first

    for back in ("double click", "button"):
        drag(page, 1, 0.5, 2.5)
        assert zoom_label(page) == "0.50 – 2.50 s"
        if back == "button":
            page.locator(".whole-run").click()
        else:
            page.mouse.dblclick(*place(page, 1, 3.0))
        assert zoom_label(page) is None

    # A wheel scrolls; with ctrl it zooms, and the time under the pointer stays.
    page.mouse.move(*place(page, 1, 2.0))
    page.mouse.wheel(0, -1)
    assert zoom_label(page) is None
    page.mouse.move(*place(page, 1, 2.0))
    page.keyboard.down("Control")
    page.mouse.wheel(0, -120)
    page.keyboard.up("Control")
    page.wait_for_selector(".whole-run:not([hidden])")
    label = zoom_label(page)
    assert label is not None
    start, end = map(float, label.removesuffix(" s").split(" – "))
    assert (start + end) / 2 == pytest.approx(2.0, abs=0.03)
    assert end - start == pytest.approx(4.0 * np.exp(-0.6), abs=0.03)


@pytest.mark.browser
def test_in_a_gap_a_curve_has_no_value(page: Any) -> None:
    script = """(moments) => {
      const times = new Float64Array([0, 1, 2, 3]);
      const values = new Float32Array([0, 10, 20, 30]);
      const curve = {times, values, gaps: [[0.5, 1.5], [2.5, 3]]};
      return moments.map((time) => valueAt(curve, time));
    }"""
    moments = [-1, 0, 0.49, 0.5, 1.49, 1.5, 2.4, 2.5, 3, 4]
    expected = [None, 0, 4.9, None, None, 15, 24, None, None, None]
    assert page.evaluate(script, moments) == pytest.approx(expected, abs=1e-5)


@pytest.mark.browser
def test_a_plot_is_used_with_the_keyboard(page: Any) -> None:
    picture = page.locator("#side figure").first
    picture.focus()
    speed = page.evaluate("player.speed")
    page.keyboard.press("+")
    assert zoom_label(page) == "0.50 – 2.50 s"  # about the cursor, at 1 s
    page.keyboard.press("+")
    assert zoom_label(page) == "0.75 – 1.75 s"
    assert page.evaluate("player.speed") == speed
    page.keyboard.press("Shift+ArrowRight")
    assert page.evaluate("player.time") == 2
    assert zoom_label(page) == "1.50 – 2.50 s"  # the cursor stays in view
    assert picture.get_attribute("aria-valuenow") == "2"
    assert "t = 2.00 s: " in picture.get_attribute("aria-valuetext")
    page.keyboard.press("-")
    assert zoom_label(page) == "1.00 – 3.00 s"
    page.keyboard.press("Home")
    assert zoom_label(page) is None
    assert page.evaluate("player.time") == 2
    page.keyboard.press("Home")
    assert page.evaluate("player.time") == 0


def seen(page: Any, path: str) -> bool:
    """Whether a camera sees objects below a node."""
    return page.evaluate(
        """(path) => {
          const meshes = [];
          findNode(viewer, path).object.traverse((thing) => {
            if (thing.isMesh) meshes.push(thing);
          });
          return meshes.some((mesh) => mesh.layers.test(viewer.camera.layers));
        }""",
        path,
    )


@pytest.mark.browser
def test_the_switch_shows_one_run_or_both(page: Any) -> None:
    def state() -> tuple[str, bool, bool, bool]:
        pressed = page.locator(".run-switch [aria-pressed=true]").inner_text()
        paths = ("/robot", "/without/robot", "/without/targets")
        return (pressed, *(seen(page, path) for path in paths))  # type: ignore[return-value]

    def opacities() -> set[float]:
        found = page.evaluate(
            """() => {
              const found = [];
              const robot = findNode(viewer, "/without/robot").object;
              eachMaterial(robot, ({opacity}) => found.push(opacity));
              return found;
            }"""
        )
        return set(found)

    def pale() -> list[float]:
        """Opacities of the joints' curves, those of one run first."""
        found = page.evaluate(f"side.plots[{JOINTS}].chart.series.slice(1)"
                              ".map(({alpha}) => alpha)")  # fmt: skip
        return sorted(found)

    names = page.locator(".run-switch button").all_inner_texts()
    assert names == ["with", "without", "both"]
    assert state() == ("both", True, True, False)
    assert opacities() == {0.38}
    assert pale() == [1] * 6
    page.keyboard.press("w")
    assert state() == ("with", True, False, False)
    assert pale() == [0.3] * 3 + [1] * 3
    assert all(" | " not in text for text in outputs(page, JOINTS))
    page.keyboard.press("w")
    assert state() == ("without", False, True, True)
    assert opacities() == {1}
    # The legend's switches keep their meaning: they hide robots of both runs.
    row = page.locator("#layers button").get_by_text("robot", exact=True)
    assert row.get_attribute("aria-pressed") == "true"
    row.click()
    page.keyboard.press("w")
    assert row.get_attribute("aria-pressed") == "false"
    assert not page.evaluate("findNode(viewer, '/without/robot').object.visible")
    row.click()
    page.locator(".run-switch button").first.click()
    assert state() == ("with", True, False, False)
    page.keyboard.press("Space")
    assert page.evaluate("player.playing")


@pytest.mark.browser
def test_the_floor_is_drawn_where_the_effort_is_held(page: Any) -> None:
    section = page.locator("#side section").nth(1)
    assert section.locator("small").inner_text() == "effort held for 2 ms"
    names = section.locator("li span").all_inner_texts()
    assert names[-1] == "held effort: expected floor"
    filled = "side.plots[1].curves.filter(({band}) => band).length"
    assert page.evaluate(filled) == 2  # of both runs
    page.evaluate("player.seek(3.5)")
    *_, actual, floor = outputs(page, 1)
    assert numbers([actual]) == pytest.approx(numbers([floor]), rel=0.3)
