"""The page's player in a real browser: its picture at a time, and its controls.

Chromium without a window; where there is none these tests are skipped, but not in CI.
"""

from collections.abc import Iterator
from typing import Any

import browsers
import numpy as np
import pytest
from browsers import until

from hsp_control import Robot
from hsp_control.companions.viewer import Viewer, threejs
from hsp_control.companions.viewer.clip import Band, Clip, Track, set_clip
from hsp_control.companions.viewer.commands import (
    set_object,
    set_trail,
)
from hsp_control.companions.viewer.threejs import collada_object

pytest.importorskip("playwright.sync_api")

JOINT, TRAIL = "/robot/joint1", "/paths/tip/actual"
TIMES = np.linspace(1.0, 3.0, 21)


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    with Viewer(Robot.load("planar3r")) as viewer:
        yield viewer


@pytest.fixture(scope="module")
def opened(browser: Any, viewer: Viewer) -> Iterator[tuple[Any, list[str]]]:
    size = {"width": 900, "height": 600}
    url = str(viewer.url)
    page, wrong = browsers.opened(browser, url, lightly=True, viewport=size)
    assert viewer.wait_for_browser(200.0)
    yield page, wrong
    page.close()


@pytest.fixture
def page(opened: tuple[Any, list[str]], viewer: Viewer) -> Iterator[Any]:
    page, wrong = opened
    tell(viewer, [*trail(), *set_clip(clip())])
    yield page
    assert wrong == []


def turns(times: np.ndarray) -> np.ndarray:
    half = 0.4 * times
    return np.column_stack([0 * half, 0 * half, np.sin(half), np.cos(half)])


def clip(stop: int = 21, horizon: float | None = None) -> Clip:
    times = TIMES[:stop]
    rings = np.arange(stop, dtype=float)[:, None]
    scale = np.column_stack([times, 0.0 * times, 1.0 + 0.0 * times])
    tracks = [
        Track(JOINT, "quaternion", times, turns(times)),
        Track(JOINT, "position", times, np.outer(times, [1.0, 2.0, 3.0])),
        Track(JOINT, "scale", times[::4], scale[::4]),
        Track(f"{JOINT}/link1", "visible", times, (times < 2.0).astype(float)[:, None]),
        Track(TRAIL, "length", times, rings),
        Track("/missing/node", "position", times, np.zeros((stop, 3))),
    ]
    return Clip(1.0, float(times[-1]), tracks, horizon)


def trail() -> list[Any]:
    points = np.column_stack([np.cos(TIMES), np.sin(TIMES), 0 * TIMES])
    return [set_trail(TRAIL, points, 0.02, 0x0072B2)]


def tell(viewer: Viewer, commands: list[Any]) -> None:
    viewer.transport.send(commands)
    assert viewer.wait_for_browser(200.0)


def player(page: Any, name: str) -> Any:
    return page.evaluate(f"player.{name}")


def thing(page: Any, name: str) -> Any:
    return page.evaluate(f"node('{JOINT}').{name}.toArray()")


@pytest.mark.browser
def test_a_time_is_shown_exactly(page: Any) -> None:
    for moment in (1.0, 1.234, 2.5, 3.0):
        page.evaluate("(t) => player.seek(t)", moment)
        angle = np.array(thing(page, "quaternion"))
        expected = turns(np.array([moment]))[0]
        assert abs(angle @ expected) == pytest.approx(1.0, abs=1e-7)
        place = thing(page, "position")
        np.testing.assert_allclose(place, np.outer(moment, [1, 2, 3])[0], atol=1e-6)
        size = thing(page, "scale")
        assert size[0] == pytest.approx(moment, abs=1e-6)
        assert 0.0 < size[1] < 1e-6  # none, but not without an inverse
        rings = page.evaluate(
            f"node('{TRAIL}').children[0].geometry.drawRange.count / 48"
        )
        assert rings == int((moment - 1.0) * 10.0 + 1e-6)
    page.evaluate("player.seek(-5)")
    assert player(page, "time") == 1.0
    page.evaluate("player.seek(50)")
    assert player(page, "time") == 3.0
    assert page.evaluate("viewer.scene_tree.children.missing === undefined")


@pytest.mark.browser
def test_it_is_steered_from_the_keyboard(page: Any) -> None:
    page.keyboard.press("End")
    assert player(page, "time") == 3.0
    page.keyboard.press("ArrowLeft")
    assert player(page, "time") == pytest.approx(3.0 - 1 / 30)
    page.keyboard.press("Shift+ArrowLeft")
    assert player(page, "time") == pytest.approx(2.0 - 1 / 30)
    page.keyboard.press("Home")
    assert player(page, "time") == 1.0
    page.keyboard.press("+")
    assert player(page, "speed") == 2
    for speed in (1, 0.5, 0.25, 0.1, 0.05, 0.05):
        page.keyboard.press("-")
        assert player(page, "speed") == speed
    page.keyboard.press("l")
    assert player(page, "loop") is True
    page.keyboard.press(" ")
    assert player(page, "playing") is True
    until(page, "player.time > 1.005")
    page.keyboard.press(" ")
    assert player(page, "playing") is False


# By the player's events: a slow machine may not draw a frame of a given moment.
COUNT_ROUNDS = """window.rounds = 0;
let last = player.time;
player.addEventListener("time", ({detail}) => {
  if (detail.time < last) rounds += 1;
  last = detail.time;
})"""


@pytest.mark.browser
def test_it_is_steered_from_the_page(page: Any) -> None:
    bar = page.locator(".player")
    assert bar.is_visible()
    box = page.locator(".timeline").bounding_box()
    page.mouse.click(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    assert player(page, "time") == pytest.approx(2.0, abs=0.05)
    assert page.locator(".clock").inner_text() == f"{player(page, 'time'):.2f} / 3.00 s"
    page.locator(".start").click()
    assert player(page, "time") == 1.0
    page.locator(".speed").select_option("4")
    assert player(page, "speed") == 4
    page.locator(".toggle").click()
    until(page, "!player.playing && player.time === player.end")  # once, to its end
    page.locator(".loop").click()
    page.evaluate(COUNT_ROUNDS)
    page.locator(".toggle").click()  # from the start again, and again
    until(page, "rounds >= 2")
    page.locator(".toggle").click()
    # The bar's keys still work, wherever the focus is.
    page.locator(".timeline").focus()
    page.keyboard.press("Home")
    assert player(page, "time") == 1.0
    page.locator(".speed").select_option("0.05")
    page.keyboard.press("ArrowRight")
    assert player(page, "time") == pytest.approx(1.0 + 1 / 30)
    page.locator(".toggle").click()
    assert player(page, "playing") is True
    page.keyboard.press(" ")  # once, not also by the focused button
    assert player(page, "playing") is False


BANDS = [
    Band("limit active", "a limit is active", "#E69F00", [(1.1, 1.4), (2.0, 2.2)]),
    Band("damped", "the law is damped", "#882255", [(2.1, 2.5)]),
]


def moments(page: Any) -> list[str]:
    return list(page.locator(".moments span").all_inner_texts())


@pytest.mark.browser
def test_the_time_line_has_labelled_bands(page: Any, viewer: Viewer) -> None:
    tell(viewer, set_clip(clip()._replace(bands=BANDS)))
    bands, name = page.locator(".bands button"), page.locator(".band-name")
    assert bands.count() == 3
    line = page.locator(".bands").bounding_box()
    second = bands.nth(1).bounding_box()
    share = (second["x"] - line["x"]) / line["width"]
    assert share == pytest.approx(0.5, abs=0.005)  # from 1 to 3 s
    assert second["width"] / line["width"] == pytest.approx(0.1, abs=0.005)

    assert name.is_hidden()
    bands.nth(1).hover()
    assert name.inner_text() == "limit active 2.00–2.20 s"
    bands.nth(2).click()
    assert player(page, "time") == 2.1
    page.mouse.move(10, 10)
    assert name.is_hidden()
    bands.nth(0).focus()
    assert name.inner_text() == "limit active 1.10–1.40 s"
    page.keyboard.press("Enter")
    assert player(page, "time") == 1.1
    bands.nth(0).blur()
    assert name.is_hidden()

    for moment, reported in (
        (1.05, []),
        (1.4, ["a limit is active"]),
        (2.15, ["a limit is active", "the law is damped"]),
        (2.3, ["the law is damped"]),
        (3.0, []),
    ):
        page.evaluate("(t) => player.seek(t)", moment)
        assert moments(page) == reported


@pytest.mark.browser
def test_presenting_leaves_the_scene_its_title_and_events(
    page: Any, viewer: Viewer
) -> None:
    tell(viewer, set_clip(clip()._replace(bands=BANDS)))
    page.evaluate("player.seek(2.15)")
    height = "document.querySelector('#caption h1').offsetHeight"
    before = page.evaluate(height)
    rest = page.evaluate("Presentation.REST")
    assert rest == 2000  # ms
    page.evaluate("Presentation.REST = 1e8")  # a slow machine must not miss the bar
    page.keyboard.press("p")
    assert page.evaluate("presentation.on")
    assert page.locator("#layers").is_hidden()
    assert page.evaluate(height) > before
    page.mouse.move(300, 300)
    assert page.locator(".player").is_visible()
    page.evaluate("Presentation.REST = 10")
    page.mouse.move(310, 300)
    until(page, "document.body.classList.contains('resting')")
    until(page, "getComputedStyle(document.querySelector('.player')).opacity === '0'")
    assert page.locator(".player").is_hidden()
    assert moments(page) == ["a limit is active", "the law is damped"]
    page.evaluate("Presentation.REST = 1e8")
    page.mouse.move(320, 300)
    until(page, "getComputedStyle(document.querySelector('.player')).opacity === '1'")
    page.locator(".present").click()
    assert not page.evaluate("presentation.on")
    assert page.locator("#layers").is_visible()

    page.keyboard.press("p")
    page.keyboard.press("Escape")
    until(page, "!presentation.on && !document.fullscreenElement")
    assert page.evaluate(height) == before
    page.evaluate("(rest) => { Presentation.REST = rest; }", rest)
    # Nothing is removed later.
    assert not page.evaluate("document.body.classList.contains('resting')")


MULTICOLOURED = """<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><up_axis>Z_UP</up_axis></asset>
<library_effects>
  <effect id="red"><profile_COMMON><technique sid="c"><lambert><diffuse>
    <color>1 0 0 1</color></diffuse></lambert></technique></profile_COMMON></effect>
  <effect id="blue"><profile_COMMON><technique sid="c"><lambert><diffuse>
    <color>0 0 1 1</color></diffuse></lambert></technique></profile_COMMON></effect>
</library_effects>
<library_materials>
  <material id="m-red"><instance_effect url="#red"/></material>
  <material id="m-blue"><instance_effect url="#blue"/></material>
</library_materials>
<library_geometries>{geometries}</library_geometries>
<library_visual_scenes>
  <visual_scene id="s">{nodes}</visual_scene>
</library_visual_scenes>
<scene><instance_visual_scene url="#s"/></scene>
</COLLADA>"""
GEOMETRY = """<geometry id="g{k}"><mesh>
  <source id="p{k}">
    <float_array id="a{k}" count="12">0 0 0 1 0 0 0 1 0 0 0 1</float_array>
    <technique_common><accessor source="#a{k}" count="4" stride="3">
      <param type="float"/><param type="float"/><param type="float"/>
    </accessor></technique_common>
  </source>
  <vertices id="v{k}"><input semantic="POSITION" source="#p{k}"/></vertices>
  <triangles material="red" count="1">
    <input semantic="VERTEX" source="#v{k}" offset="0"/>
    <p>0 1 2</p>
  </triangles>
  <triangles material="blue" count="2">
    <input semantic="VERTEX" source="#v{k}" offset="0"/>
    <p>0 1 3 0 2 3</p>
  </triangles>
</mesh></geometry>"""
NODE = """<node id="n{k}"><instance_geometry url="#g{k}"><bind_material>
  <technique_common>
    <instance_material symbol="red" target="#m-red"/>
    <instance_material symbol="blue" target="#m-blue"/>
  </technique_common>
</bind_material></instance_geometry></node>"""


@pytest.mark.browser
@pytest.mark.parametrize("parts", [1, 2])
def test_every_triangle_of_a_mesh_file_has_its_surface(
    page: Any, viewer: Viewer, tmp_path: Any, parts: int
) -> None:
    """Two surfaces within one part, as in the UR5's files, in one part and in two."""
    file = tmp_path / "mesh.dae"
    text = MULTICOLOURED.format(
        geometries="".join(GEOMETRY.format(k=k) for k in range(parts)),
        nodes="".join(NODE.format(k=k) for k in range(parts)),
    )
    file.write_text(text)
    tell(viewer, [set_object("/mesh", threejs.group([collada_object(file)]))])
    groups = page.evaluate(
        """() => {
          const found = [];
          node("/mesh").traverse(({geometry, material}) => {
            if (!geometry) return;
            for (const {start, count, materialIndex} of geometry.groups) {
              const {r, g, b} = material[materialIndex].color;
              found.push([start, count, [r, g, b]]);
            }
          });
          return found;
        }"""
    )
    expected = [
        [start, count, color]
        for k in range(parts)
        for start, count, color in ((9 * k, 3, [1, 0, 0]), (9 * k + 3, 6, [0, 0, 1]))
    ]
    assert groups == expected
