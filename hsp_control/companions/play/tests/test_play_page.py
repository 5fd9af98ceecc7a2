"""The page of `hsp play` in a real browser: motions of the hand, and messages.

Chromium without a window; where there is none these tests are skipped, but not in CI.
The page is that of a real server. Its commands come from the tests, which also record
its messages.
"""

import json
from collections.abc import Iterator, Sequence
from typing import Any

import browsers
import numpy as np
import pinocchio as pin
import pytest
from browsers import PATIENCE, until
from places import further

from hsp_control import Robot
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.commands import unpack
from hsp_control.companions.viewer.ghosts import Ghosts

TURN = [0.0, np.sin(0.2), 0.0, np.cos(0.2)]
HAND, ELBOW, BALL = [0.9, 0.3, 0.25, *TURN], [0.2, 0.9, 0.1, *TURN], [-0.4, 0.5, 0.3]
SETUP: dict[str, Any] = {
    "type": "play_setup", "path": "/play", "title": "three joints",
    "targets": [
        {"name": "hand", "kind": "pose", "axes": [True] * 3, "pose": HAND},
        {"name": "elbow", "kind": "position", "axes": [True, True, False],
         "pose": ELBOW},
    ],
    "obstacles": [
        {"name": "ball", "path": "/obstacles/ball", "position": BALL, "radius": 0.1}
    ],
    "controls": [
        {"id": "stiffness", "group": "Hand", "label": "Stiffness", "unit": "N/m",
         "kind": "slider", "value": 400.0, "low": 10.0, "high": 4000.0, "log": True},
        {"id": "friction", "group": "Robot", "label": "Friction", "kind": "switch",
         "value": False},
    ],
    "plots": [
        {"id": "error", "title": "Error", "unit": "mm", "log": True,
         "series": [{"name": "hand", "color": "#0072B2"}]},
        {"id": "torque", "title": "Torque", "unit": "N m", "log": False,
         "series": [{"name": "q1", "color": "#0072B2"},
                    {"name": "q2", "color": "#22272B"}],
         "lines": [{"value": 87.0, "name": "limit of q1", "curves": [0]},
                   {"value": 1.0, "name": "limit of q2", "curves": [1]}]},
    ],
    "pull": True, "loop": "simulated", "period_ms": 1.0,
}  # fmt: skip

# Record the page's messages; the server gets only those that it knows.
LISTEN = """() => {
  window.sent = [];
  const {connection} = viewer, send = connection.send.bind(connection);
  connection.send = (text) => {
    if (text[0] === "{") sent.push(text); else send(text);
  };
}"""
PIXEL = """(point) => {
  const {x, y} = play.sight.update().project(new MeshCat.THREE.Vector3(...point));
  return [x, y];
}"""
# A pixel at which a press grabs only this handle; handles extend over 100 pixels.
HANDLE = """([name, kind, axis]) => {
  const gizmo = [...play.gizmos.values()].find(({target}) => target.name === name);
  const middle = play.sight.update().project(gizmo.position);
  for (let y = middle.y - 100; y < middle.y + 100; y += 2) {
    for (let x = middle.x - 100; x < middle.x + 100; x += 2) {
      const {gizmo: taken, handle, gap} = play.hand.find(x, y, "mouse") ?? {};
      if (taken === gizmo && handle.kind === kind && handle.axis === axis && gap < 1.5)
        return [x, y];
    }
  }
  return null;
}"""
# The visible elements of a kind in one query, since a query takes a second.
BOXES = """(selector) => [...document.querySelectorAll(selector)]
  .filter((one) => one.checkVisibility()).map((one) => {
    one.scrollIntoView({block: "nearest"});
    const {left, right, height} = one.getBoundingClientRect();
    return [left, right, height, one.getAttribute("role"), one.outerHTML];
  })"""
LINK = """() => {
  const {left, top, width, height} = play.sight.update().box;
  for (let y = top; y < top + height; y += 12) {
    for (let x = left; x < left + width; x += 12) {
      if (play.hand.find(x, y, "mouse")?.path) return [x, y];
    }
  }
  return null;
}"""


@pytest.fixture(scope="module")
def viewer() -> Iterator[Viewer]:
    robot = Robot.load("planar3r")
    with Viewer(robot, camera=[1.5, -4.5, 3.0], target=[0.4, 0.2, 0.0]) as viewer:
        viewer.show(robot.integrate(robot.neutral(), np.array([0.4, 0.5, 0.3])))
        yield viewer


def opened(browser: Any, viewer: Viewer, **options: Any) -> tuple[Any, list[str]]:
    page, wrong = browsers.opened(browser, str(viewer.url), **options)
    assert viewer.wait_for_browser(PATIENCE)
    page.evaluate(LISTEN)
    return page, wrong


@pytest.fixture(scope="module")
def desktop(browser: Any, viewer: Viewer) -> Iterator[tuple[Any, list[str]]]:
    page, wrong = opened(browser, viewer, viewport={"width": 960, "height": 600})
    yield page, wrong
    page.close()


@pytest.fixture
def page(desktop: tuple[Any, list[str]]) -> Iterator[Any]:
    page, wrong = desktop
    begin(page)
    page.evaluate("play.panel.setOpen(true); viewer.render()")
    yield page
    page.mouse.up()
    page.mouse.move(5, 500)
    assert wrong == []


def begin(page: Any) -> None:
    tell(page, "play_drive", mine=True, taken=True)
    page.evaluate("(command) => viewer.handle_command(command)", SETUP)
    tell(page, "play_state", t=1.5, running=True, rate=1.0, message="", level="info")
    page.evaluate("play.keys.escape(); viewer.render(); sent.length = 0")


def tell(page: Any, kind: str, **fields: Any) -> None:
    command = {"type": kind, "path": "/play", **fields}
    page.evaluate("(command) => viewer.handle_command(command)", command)


def sent(page: Any, do: str | None = None) -> list[dict[str, Any]]:
    messages = [json.loads(text) for text in page.evaluate("sent")]
    return [message for message in messages if do in (None, message["do"])]


def until_sent(page: Any, do: str, number: int = 1) -> list[dict[str, Any]]:
    until(page, f"sent.filter((t) => JSON.parse(t).do === '{do}').length >= {number}")
    return sent(page, do)


def pixel(page: Any, point: list[float]) -> np.ndarray:
    return np.array(page.evaluate(PIXEL, point[:3]))


def drag(page: Any, start: Any, end: Any) -> None:
    """Press at a pixel and move to another one; the button stays down."""
    first, last = np.array(start, float), np.array(end, float)
    page.mouse.move(*first)
    page.mouse.down()
    page.mouse.move(*(0.5 * (first + last)))
    page.mouse.move(*last)


def lies_under(page: Any, point: list[float], pointer: Any) -> bool:
    """Whether a point's picture is within 1 mm of a pixel."""
    x, y, z = point[:3]
    size = page.evaluate(f"play.sight.pixel(new MeshCat.THREE.Vector3({x}, {y}, {z}))")
    return float(np.linalg.norm(pixel(page, point) - pointer)) * size < 1e-3


@pytest.mark.browser
def test_the_ball_stays_under_the_pointer(page: Any) -> None:
    start = pixel(page, HAND)
    end = start + np.array([70.0, -45.0])
    drag(page, start, end)
    until_sent(page, "move")
    # While a slider is held, the program's value of it is not shown; others' are.
    elsewhere = {"hand": [0, 0, 0, 0, 0, 0, 1], "elbow": [0.3, *ELBOW[1:]]}
    tell(page, "play_targets", poses=elsewhere)
    held, free, _ = page.evaluate("[...play.gizmos.values()].map((one) => one.pose())")
    assert lies_under(page, held, end)
    assert free == pytest.approx(elsewhere["elbow"])
    page.mouse.up()
    *moves, last = sent(page)
    assert last == {"do": "release", "target": "hand"}
    assert {message["do"] for message in moves} == {"move"}
    assert moves[-1]["target"] == "hand"
    assert lies_under(page, moves[-1]["pose"], end)
    assert moves[-1]["pose"][3:] == pytest.approx(TURN)
    assert page.evaluate("viewer.controls.enabled") is True


@pytest.mark.browser
@pytest.mark.parametrize("axis", [2, *further(0, 1)])
def test_an_arrow_moves_along_its_axis(page: Any, axis: int) -> None:
    start = np.array(page.evaluate(HANDLE, ["hand", "arrow", axis]))
    along = pixel(page, [HAND[k] + 0.1 * (k == axis) for k in range(3)])
    drag(page, start, start + (along - pixel(page, HAND)))
    page.mouse.up()
    pose = until_sent(page, "move")[-1]["pose"]
    expected = [HAND[k] + 0.1 * (k == axis) for k in range(3)]
    assert pose[axis] == pytest.approx(expected[axis], abs=0.02)
    others = [k for k in range(3) if k != axis]
    np.testing.assert_allclose(
        np.array(pose)[others], np.array(HAND)[others], atol=1e-12
    )
    assert pose[3:] == pytest.approx(TURN)


@pytest.mark.browser
@pytest.mark.parametrize("axis", [0, *further(1, 2)])
def test_a_ring_turns_about_its_axis(page: Any, axis: int) -> None:
    start = np.array(page.evaluate(HANDLE, ["hand", "ring", axis]))
    spoke = start - pixel(page, HAND)
    drag(page, start, start + 0.5 * spoke[::-1] * [-1.0, 1.0])
    page.mouse.up()
    pose = np.array(until_sent(page, "move")[-1]["pose"])
    assert pose[:3] == pytest.approx(HAND[:3], abs=1e-12)
    x, y, z, w = pose[3:]
    # In the target's axes: the conjugate of its orientation times the new one.
    _, b, _, a = TURN
    local = np.array([a * x - b * z, a * y - b * w, a * z + b * x])
    assert a * w + b * y < 1.0 - 1e-5  # it has rotated
    assert np.delete(local, axis) == pytest.approx([0.0, 0.0], abs=1e-9)


@pytest.mark.browser
def test_the_keyboard_moves_by_a_centimetre(page: Any) -> None:
    page.keyboard.press("1")
    assert page.evaluate("document.activeElement.ariaLabel").startswith("Target hand")
    page.evaluate("viewer.render()")
    label = page.locator(".play-label.name:not([hidden])")
    assert label.inner_text() == "hand"
    before = np.array(HAND[:3])
    # The camera is at negative y: x to the right, y away from it, z up.
    for key, axis, step in (
        ("ArrowRight", 0, 0.01),
        ("ArrowRight", 0, 0.01),
        ("ArrowLeft", 0, -0.01),
        ("ArrowUp", 1, 0.01),
        ("ArrowDown", 1, -0.01),
        ("PageUp", 2, 0.01),
        ("Shift+PageDown", 2, -0.001),
        ("Shift+ArrowUp", 1, 0.001),
    ):
        page.evaluate("sent.length = 0")
        page.keyboard.press(key)
        until_sent(page, "release")
        move, release = sent(page)
        assert release == {"do": "release", "target": "hand"}
        after = np.array(move["pose"][:3])
        expected = step * (np.arange(3) == axis)
        np.testing.assert_allclose(after - before, expected, atol=1e-12)
        before = after
    page.keyboard.press("Tab")
    assert page.evaluate("play.selected") == "target elbow"
    page.keyboard.press("3")
    page.evaluate("sent.length = 0")
    page.keyboard.press("ArrowRight")
    (moved,) = until_sent(page, "obstacle")
    assert moved["position"] == pytest.approx([BALL[0] + 0.01, *BALL[1:]], abs=1e-12)
    page.keyboard.press("Escape")
    assert page.evaluate("play.selected") is None


@pytest.mark.browser
def test_a_plot_draws_the_limits_of_its_curves(page: Any) -> None:
    """For a single shown curve only its own limits, within the axis."""
    # Two joints, at 0.9 and at 1.1, which is beyond the second one's limit of 1.
    page.evaluate(
        """() => {
          for (let t = 0; t < 1; t += 0.1) {
            play.plots.add([t], Float32Array.of(0.01, 0.9, 1.1));
          }
          play.plots.plots[1].update();
        }"""
    )
    plot = page.locator(".play-plots .plot").nth(1)
    edges = plot.locator(".edge")
    assert edges.all_inner_texts() == ["limit of q2"]  # the first is far from 87
    near = plot.locator("output.near").all_inner_texts()
    assert near == ["1.100"]
    plot.locator("button").nth(0).click()
    assert edges.all_inner_texts() == ["limit of q1"]
    plot.locator("button").nth(1).click()
    until(page, "play.plots.plots[1].alone === 1")
    assert edges.all_inner_texts() == ["limit of q2"]
    plot.locator("button").nth(1).click()


@pytest.mark.browser
def test_key_and_button_compare_laws_and_the_other_one_is_a_ghost(page: Any) -> None:
    button = page.locator(".play-bar .other")
    tell(page, "play_laws", laws=[], law="")
    assert not button.is_visible()
    laws = ["no field", "operational-space law"]
    for law, following in (("", laws[0]), (laws[0], laws[1]), (laws[1], "")):
        tell(page, "play_laws", laws=laws, law=law)
        assert button.get_attribute("aria-pressed") == str(bool(law)).lower()
        page.evaluate("sent.length = 0")
        page.keyboard.press("o")
        button.click()
        assert until_sent(page, "compare", 2) == 2 * [
            {"do": "compare", "law": following}
        ]
    preview = page.locator(".play-bar .preview")
    for on in (False, True):
        tell(page, "play_preview", on=on)
        assert preview.get_attribute("aria-pressed") == str(on).lower()
        page.evaluate("sent.length = 0")
        page.keyboard.press("m")
        preview.click()
        assert until_sent(page, "preview", 2) == 2 * [{"do": "preview", "on": not on}]
    robot = Robot.load("planar3r")
    ghosts = Ghosts("other law", robot, "#117733", 0.4)
    q = robot.integrate(robot.neutral(), np.array([0.4, 0.5, -0.6]))
    command = unpack(ghosts.show([q], "no field").packed)
    command["poses"] = command["poses"].tolist()
    page.evaluate("(command) => viewer.handle_command(command)", command)
    page.evaluate("viewer.render()")
    assert page.locator(".play-label.ghost").inner_text() == "no field"
    placed = page.evaluate(
        """() => {
          const [ghost] = play.ghosts.groups.get("other law");
          return ghost.children.map(({name, position}) => [name, position.toArray()]);
        }"""
    )
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, q)
    expected = [
        (name, data.oMi[joint].translation)
        for joint, name in enumerate(robot.model.names)
        if joint
    ]
    for (name, position), (known, there) in zip(placed, expected, strict=True):
        assert name == known
        np.testing.assert_allclose(position, there, atol=1e-6)
    own = page.evaluate("""() => {
      const shown = (root) => {
        const found = [];
        root.traverse(({geometry}) => geometry && found.push(geometry.uuid));
        return found;
      };
      const [ghost] = play.ghosts.groups.get("other law");
      return [shown(ghost), shown(node("/robot"))];
    }""")
    assert own[0]
    assert set(own[0]) <= set(own[1])  # it shares the geometries
    page.evaluate("play.ghosts.clear()")


@pytest.mark.browser
@pytest.mark.smoke
def test_keys_steer_the_run(page: Any) -> None:
    for key, do in ((" ", "pause"), (".", "step"), ("r", "reset"), ("s", "save")):
        page.keyboard.press(key)
        until_sent(page, do)
    tell(page, "play_state", t=2.0, running=False, rate=0.0, message="", level="info")
    page.keyboard.press(" ")
    until_sent(page, "go")
    assert page.locator(".play-bar .toggle").get_attribute("aria-label") == "Go"
    page.locator(".play-bar .step").click()
    until_sent(page, "step", 2)
    page.keyboard.press(" ")  # not the button again
    until_sent(page, "go", 2)
    assert len(sent(page, "step")) == 2


@pytest.mark.browser
def test_the_key_of_a_live_loop_is_held(page: Any) -> None:
    """By the space bar or the button; losing focus releases it."""
    live = SETUP | {"loop": "held"}
    page.evaluate("(command) => viewer.handle_command(command)", live)
    page.evaluate("sent.length = 0")
    assert not page.locator(".play-bar .toggle").is_visible()
    for release in ("up", "blur", "watching"):
        page.keyboard.down(" ")
        assert len(until_sent(page, "hold", 3)) >= 3  # again and again
        assert all(message["held"] for message in sent(page, "hold"))
        if release == "watching":
            tell(page, "play_drive", mine=False, taken=True)
            assert not page.evaluate("play.holdKey.held")
            tell(page, "play_drive", mine=True, taken=True)
        elif release == "blur":
            page.evaluate("dispatchEvent(new Event('blur'))")
        page.keyboard.up(" ")
        if release != "watching":
            assert sent(page, "hold")[-1] == {"do": "hold", "held": False}
        page.evaluate("sent.length = 0")
    button = page.locator(".play-bar .hold")
    button.hover()
    page.mouse.down()
    until_sent(page, "hold", 2)
    assert button.get_attribute("aria-pressed") == "true"
    page.mouse.up()
    assert sent(page, "hold")[-1] == {"do": "hold", "held": False}
    for key in (".", "r", "s"):
        page.keyboard.press(key)
    page.locator(".play-bar .stop").click()
    until_sent(page, "stop")
    assert {message["do"] for message in sent(page)} == {"hold", "stop"}
    page.evaluate("play.holdKey.button.remove(); play.holdKey = null")


@pytest.mark.browser
def test_an_obstacle_is_dragged(page: Any) -> None:
    start = pixel(page, BALL)
    end = start + np.array([-30.0, -50.0])
    drag(page, start, end)
    page.mouse.up()
    moved = until_sent(page, "obstacle")[-1]
    assert moved["name"] == "ball"
    assert lies_under(page, moved["position"], end)
    assert sent(page)[-1] == {"do": "release", "name": "ball"}


@pytest.mark.browser
def test_an_obstacle_comes_to_the_robot_that_it_is_dragged_over(page: Any) -> None:
    link = np.array(page.evaluate(LINK))
    drag(page, pixel(page, BALL), link)
    page.mouse.up()
    place = np.array(until_sent(page, "obstacle")[-1]["position"])
    assert abs(place[2]) < 0.15  # the arm's plane; it has begun at 0.3
    # Its arrow moves it along an axis, and a line connects it to the floor.
    start = np.array(page.evaluate(HANDLE, ["ball", "arrow", 2]))
    drag(page, start, start + np.array([0.0, -40.0]))
    page.mouse.up()
    risen = np.array(until_sent(page, "obstacle", 2)[-1]["position"])
    np.testing.assert_allclose(risen[:2], place[:2], atol=1e-9)
    assert risen[2] > place[2] + 0.05
    lines = (
        "play.gizmos.get('obstacle ball').parts.find((p) => p.handle.kind === 'line')"
    )
    assert page.evaluate(f"{lines}.meshes.every((mesh) => mesh.visible)")


@pytest.mark.browser
def test_a_link_is_pulled(page: Any) -> None:
    start = page.evaluate(LINK)
    end = np.array(start) + np.array([-60.0, -60.0])
    drag(page, start, end)
    first = until_sent(page, "pull")[0]
    assert first["path"].startswith("/robot/joint")
    distance = """({path, point}) => {
      const {Box3, Vector3} = MeshCat.THREE;
      const at = new Vector3(...point).applyMatrix4(viewer.scene.matrixWorld);
      return new Box3().setFromObject(node(path)).distanceToPoint(at);
    }"""
    assert page.evaluate(distance, first) < 1e-6
    assert lies_under(page, first["point"], start)
    until(page, "play.pending.size === 0")
    assert lies_under(page, sent(page, "pull")[-1]["to"], end)
    force = {"from": first["point"], "to": first["point"]}
    tell(page, "play_force", visible=True, newtons=23.4, **force)
    page.evaluate("viewer.render()")
    assert page.locator(".play-label.force").inner_text() == "23 N"
    page.mouse.up()
    assert sent(page)[-1] == {"do": "let_go"}
    page.evaluate("viewer.render()")
    assert page.locator(".play-label.force").is_hidden()


def told_until(page: Any, values: dict[str, Any], expression: str) -> None:
    """Send the settings, as with every frame, until an expression is true."""
    text = json.dumps(values)
    until(page, f"viewer.handle_command({{type: 'play_values', values: {text}}}), "
          + expression)  # fmt: skip


@pytest.mark.browser
def test_a_refused_value_goes_back(page: Any) -> None:
    """Which of two values is older depends on timing: here time is frozen."""
    page.evaluate("window.usual = [Play.ECHO, PlayPanel.PATIENCE]")
    page.evaluate("Play.ECHO = PlayPanel.PATIENCE = 1e9")
    slider, shown = page.locator("#play-stiffness"), page.locator(".slider output")
    before = slider.input_value()
    slider.fill("0.5")  # the middle, on a logarithmic scale
    assert until_sent(page, "set")[-1] == {"do": "set", "id": "stiffness", "value": 200}
    assert shown.inner_text() == "200 N/m"
    tell(page, "play_values", values={"stiffness": 400.0})
    assert shown.inner_text() == "200 N/m"  # the program had not received it yet
    page.evaluate("Play.ECHO = PlayPanel.PATIENCE = 0")
    told_until(page, {"stiffness": 400.0}, "document.querySelector('#play-stiffness')"
               ".getAttribute('aria-valuetext') === '400 N/m'")  # fmt: skip
    assert slider.input_value() == before
    page.evaluate("sent.length = 0; Play.ECHO = PlayPanel.PATIENCE = 1e9")
    page.get_by_role("switch", name="Friction").click()
    until_sent(page, "set")
    assert [message["value"] for message in sent(page)] == [True]
    tell(page, "play_values", values={"friction": False})
    assert page.get_by_role("switch", name="Friction").is_checked()
    page.evaluate("Play.ECHO = PlayPanel.PATIENCE = 0")
    told_until(
        page, {"friction": False}, "!document.querySelector('.switch input').checked"
    )
    page.evaluate("[Play.ECHO, PlayPanel.PATIENCE] = window.usual")


@pytest.mark.browser
def test_a_target_and_an_obstacle_return_to_their_paths(page: Any) -> None:
    for name in ("elbow", "ball"):
        page.get_by_role("button", name=f"{name}: back to its own path").click()
    assert sent(page) == [
        {"do": "resume", "target": "elbow"},
        {"do": "resume", "name": "ball"},
    ]


@pytest.mark.browser
def test_a_target_out_of_reach_is_reported_at_its_handle(page: Any) -> None:
    state = {"t": 2.0, "running": True, "rate": 1.0, "level": "info"}
    words = {"hand": "target out of reach, 0.31 m", "elbow": "target far away"}
    tell(page, "play_state", message="saved", **state)
    tell(page, "play_targets", away=words)
    page.evaluate("viewer.render()")
    away = page.locator(".play-label.away")
    assert away.all_inner_texts() == list(words.values())
    box, (x, y) = away.first.bounding_box(), pixel(page, HAND)
    assert abs(box["x"] + 0.5 * box["width"] - x) < 3.0
    assert -40.0 < box["y"] + box["height"] - y < -12.0  # at the handle
    page.keyboard.press("p")  # also when presenting, without the bar
    page.wait_for_selector("body.presenting.resting", state="attached")
    status = "document.querySelector('.play-status')"
    until(page, f"getComputedStyle({status}).opacity === '0'")
    assert away.first.is_visible()
    page.keyboard.press("p")
    tell(page, "play_targets", away={})
    page.evaluate("viewer.render()")
    assert away.count() == 0


@pytest.mark.browser
def test_labels_are_right_at_every_ratio_and_range(page: Any) -> None:
    """uPlot uses whole numbers before pixels, and has no steps of 3 or 4 decades."""
    assert page.evaluate("/^\\d+px/.test(Plot.FONT)")
    steps = page.evaluate(
        "[1, 4, 6, 9, 12, 17].map((n) => Plot.DECADES.incrs(0, 1, -n, 0)[0])"
    )
    assert steps == [1, 1, 2, 2, 5, 5]
    assert page.evaluate("Plot.number(Math.log10(3e-17), true)") == "0"


@pytest.mark.browser
def test_a_slow_program_does_not_turn_a_knob_back(page: Any) -> None:
    """Messages from before the program received the change are not shown."""
    page.evaluate("play.panel.set('stiffness', 900)")
    page.evaluate("play.touched.set('set stiffness', performance.now() - 1000)")
    tell(page, "play_values", values={"stiffness": 400.0, "friction": False})
    assert page.evaluate("play.panel.wanted.has('stiffness')")
    tell(page, "play_values", values={"stiffness": 900.0, "friction": False})
    shown = page.evaluate("document.querySelector('#play-stiffness').ariaValueNow")
    assert float(shown) == 900.0
    assert not page.evaluate("play.panel.wanted.has('stiffness')")


@pytest.mark.browser
def test_bars_show_joints_against_their_limits(page: Any) -> None:
    setup = {**SETUP, "joints": ["one", "two"]}
    page.evaluate("(command) => viewer.handle_command(command)", setup)
    numbers = {"q": [0.25, 0.99], "v": [-0.5, None], "tau": [0.97, 0.1]}
    tell(page, "play_joints", **numbers)
    bars = page.evaluate(
        "play.bars.rows.map((row) => row.map((i) => [i.style.left, i.style.width, "
        "i.classList.contains('near')]))"
    )
    assert bars[0] == [
        ["25%", "", False],
        ["25%", "25%", False],
        ["50%", "48.5%", True],
    ]
    assert bars[1][0] == ["99%", "", True]
    assert bars[1][1] == ["50%", "0%", False]


@pytest.mark.browser
def test_the_slider_looks_back(page: Any) -> None:
    node = "viewer.scene_tree.find(['seen']).object"
    page.evaluate(f"{node}.name = 'seen'")  # nodes missing in the scene are ignored
    for k in range(5):
        track = {"path": "/seen", "property": "position", "values": [0.1 * k, 0, 0]}
        track |= {"times": [0.0]}
        tell(page, "pose", tracks=[track])
        place = [0.1 * k, 0.2, 0.5, 0.0, 0.0, 0.0, 1.0]
        tell(page, "play_targets", poses={"hand": place})
        tell(page, "play_state", t=2.0 + k, running=True, rate=1.0, message="")
    handle = "play.gizmos.get('target hand').position.x"
    held = "play.hand.find(...Object.values(play.sight.update().project("
    held += "play.gizmos.get('target hand').position)).slice(0, 2), 'mouse')"
    assert page.evaluate(handle) == pytest.approx(0.4)
    assert page.evaluate(f"{held} !== null")
    x = float(page.evaluate(f"{node}.position.x"))
    page.evaluate(
        "(() => { const back = document.querySelector('.back'); back.value = -2.5; "
        "back.dispatchEvent(new Event('input')); })()"
    )
    assert until_sent(page, "pause")
    assert page.evaluate("play.bar.clock.textContent") == "3.00 s"
    assert page.evaluate(f"{node}.position.x") == pytest.approx(0.1)
    assert x == pytest.approx(0.4)
    assert page.evaluate(handle) == pytest.approx(0.1)
    tell(page, "play_targets", poses={"hand": [0.7, 0.2, 0.5, 0.0, 0.0, 0.0, 1.0]})
    assert page.evaluate(handle) == pytest.approx(0.1)  # of the displayed row
    assert page.evaluate(f"{held} === null")
    page.evaluate(
        "(() => { const back = document.querySelector('.back'); back.value = 0; "
        "back.dispatchEvent(new Event('input')); back.value = -2.5; })()"
    )
    assert page.evaluate(handle) == pytest.approx(0.7)
    page.evaluate("play.touched.clear()")  # as after a moment
    for running in (False, True):  # it pauses, and later goes on
        tell(page, "play_state", t=6.0, running=running, rate=1.0, message="")
    assert not page.evaluate("play.bar.past.looking")
    # It pauses also during a start, and the space bar continues from there.
    states = [  # at once: a later one would not be older
        {"type": "play_state", "path": "/play", "t": 6.5, "running": running,
         "rate": 1.0, "message": ""}
        for running in (False, True)
    ]  # fmt: skip
    page.evaluate(
        "(states) => { sent.length = 0; const back = document.querySelector('.back'); "
        "back.value = -2; back.dispatchEvent(new Event('input')); "
        "for (const state of states) viewer.handle_command(state); }",
        states,
    )
    assert page.evaluate("play.bar.past.looking")
    assert until_sent(page, "pause")
    tell(page, "play_state", t=6.6, running=False, rate=1.0, message="")
    page.locator(".play-bar .back").focus()
    page.keyboard.press(" ")
    assert until_sent(page, "go")


@pytest.mark.browser
def test_the_name_of_a_line_covers_no_curve(page: Any) -> None:
    """A name keeps its side until a curve or another name is in the way."""
    place = """([curve, named, last]) => {
      const over = {clientWidth: 200, clientHeight: 88};
      const chart = {over, data: [curve, curve], series: [{}, {show: true}],
                     valToPos: (value) => 88 - value,
                     posToIdx: (x) => Math.round(x / 200 * (curve.length - 1))};
      return Plot.placeOf("contact", 78, chart, named, last)?.side;
    }"""

    def side(curve: list[float], named: Sequence[Any] = (), last: Any = None) -> Any:
        return page.evaluate(place, [curve, list(named), last])

    falling = np.linspace(80.0, 18.0, 100).tolist()  # 18 is in the middle of a name
    assert side(falling) == "left"
    assert side(falling[::-1]) == "right"
    above = {"below": False}
    flat = [60.0] * 100
    assert side(flat, last={"side": "center", **above}) == "center"
    taken = [{"start": 0, "width": 60, "middle": 70}]
    assert side(falling, taken, {"side": "left", **above}) == "center"


@pytest.mark.browser
def test_a_picture_is_saved_as_displayed(page: Any) -> None:
    page.evaluate(
        "(() => { window.saved = null; PlayCamera.prototype.save = (blob, ending) => "
        "{ window.saved = [blob.size, ending]; }; })()"
    )
    page.evaluate("document.querySelector('.play-bar .picture').click()")
    until(page, "window.saved !== null")
    size, ending = page.evaluate("window.saved")
    assert ending == "png"
    assert size > 5000


@pytest.mark.browser
def test_the_bar_stands_beside_the_panel(page: Any) -> None:
    bar, panel = (
        page.locator(name).bounding_box() for name in (".play-bar", ".play-panel")
    )
    assert bar["x"] >= 0
    assert bar["x"] + bar["width"] <= panel["x"]
    box = "document.querySelector('.play-bar').getBoundingClientRect()"
    assert page.evaluate(f"barHeight === innerHeight - {box}.top")


@pytest.mark.browser
def test_a_target_that_moves_out_of_the_picture_stays_in_sight(page: Any) -> None:
    page.evaluate("window.first = views.command; views.begin(first)")  # not turned
    far = [0.4, -2.2, 0.0, 0.0, 0.0, 0.0, 1.0]
    assert not 0.0 < pixel(page, far)[1] < 500.0
    tell(page, "play_targets", poses={"hand": far})
    inside = f"(({PIXEL})({far[:3]}))[1]"
    until(page, f"{inside} > 0 && {inside} < innerHeight - barHeight")
    page.evaluate("views.begin(window.first)")


@pytest.mark.browser
def test_without_a_gpu_it_draws_lightly_and_reports_it(page: Any) -> None:
    if not page.evaluate("isSoftware()"):
        pytest.skip("this browser has a graphics card")
    assert not page.evaluate("viewer.renderer.shadowMap.enabled")
    kinds = page.evaluate(
        "(() => { const found = new Set(); viewer.scene.traverse(({material}) => "
        "[material].flat().forEach((one) => found.add(one?.type))); "
        "return [...found]; })()"
    )
    assert "MeshStandardMaterial" not in kinds


@pytest.mark.browser
def test_it_fits_a_phone(browser: Any, viewer: Viewer) -> None:
    page, wrong = opened(
        browser,
        viewer,
        viewport={"width": 390, "height": 844},
        is_mobile=True,
        has_touch=True,
    )
    begin(page)
    tell(page, "play_laws", laws=["no field"], law="")
    bar = page.locator(".play-bar")
    acts = "reset", "save", "page", "other", "preview", "back", "picture", "film"
    for name in acts:
        assert bar.locator(f".{name}").is_visible(), name
    assert page.locator(".play-panel").is_hidden()
    page.locator(".play-bar .panel").tap()
    until(
        page, "getComputedStyle(document.querySelector('.play-panel')).opacity === '1'"
    )
    assert page.evaluate("innerWidth") == 390
    assert page.evaluate("document.documentElement.scrollWidth") <= 390
    things = page.evaluate(BOXES, ".play-foot button, .play-panel :is(button, input)")
    assert len(things) > 10
    for left, right, height, role, html in things:
        assert left >= 0
        assert right <= 390
        assert role == "switch" or height >= 40, html  # of a switch, the whole row
    # The legend replaces the sheet, and ends at the picture's edge.
    page.locator(".layers-toggle").tap()
    until(
        page, "getComputedStyle(document.querySelector('.play-panel')).opacity === '0'"
    )
    legend, picture = (
        page.locator(name).bounding_box() for name in ("#layers", "#meshcat-pane")
    )
    assert legend["y"] + legend["height"] <= picture["y"] + picture["height"]
    heading = page.locator("#caption h1").bounding_box()
    assert heading["x"] < 20
    page.locator(".play-bar .panel").tap()
    assert page.locator("#layers").is_hidden()
    page.get_by_role("button", name="Close the panel").tap()
    until(
        page, "getComputedStyle(document.querySelector('.play-panel')).opacity === '0'"
    )
    # A finger drags the ball; it may miss by 20 pixels.
    start = pixel(page, HAND)
    touch = page.context.new_cdp_session(page)

    def finger(kind: str, *places: np.ndarray) -> None:
        points = [{"x": float(x), "y": float(y)} for x, y in places]
        touch.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    page.evaluate("sent.length = 0")
    finger("touchStart", start + np.array([0.0, 12.0]))
    finger("touchMove", start + np.array([10.0, -10.0]))
    finger("touchMove", start + np.array([30.0, -40.0]))
    finger("touchEnd")
    until_sent(page, "release")
    *_, move, release = sent(page)
    assert (move["do"], release["do"]) == ("move", "release")
    page.close()
    assert wrong == []


@pytest.mark.browser
def test_a_browser_without_webgl_shows_a_message(browser: Any, viewer: Viewer) -> None:
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = () => null")
    page.goto(str(viewer.url))
    page.get_by_text("WebGL is off").wait_for()
    page.close()
