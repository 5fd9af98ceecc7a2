"""`hsp play` as somebody plays with it: the program, a real browser, and a mouse."""

import http.server
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import browsers
import numpy as np
import pytest
from browsers import until
from pages import Steering
from places import THOROUGH
from played import Played, wait_until

import hsp_control as hsp

pytestmark = [pytest.mark.browser, pytest.mark.process]

SMALL = {"viewport": {"width": 800, "height": 500}}  # a picture takes less time
READY = "typeof play !== 'undefined' && play.ready && play.state.t > 0"
SHADOW = """[...document.querySelectorAll("#layers button")]
  .find((row) => row.textContent === "shadow").click()"""
HAND = """() => {
  const gizmo = play.gizmos.get("target hand");
  const {x, y} = play.sight.update().project(gizmo.position);
  return [x, y];
}"""
BALL = """() => {
  const {at} = play.obstacles.get("obstacle ball");
  const {x, y} = play.sight.update().project(at);
  return [x, y];
}"""
ELBOW = """() => {
  const {left, top, width, height} = play.sight.update().box;
  for (let y = top; y < top + height; y += 5) {
    for (let x = left; x < left + width; x += 5) {
      if (play.hand.find(x, y, "mouse")?.path?.includes("panda_joint4")) return [x, y];
    }
  }
  return null;
}"""


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    yield from browsers.started()


@pytest.fixture
def played(tmp_path: Path) -> Iterator[Played]:
    process = Played("panda", "--out", str(tmp_path), "--set", "view.target=[.3,0,.4]")
    yield process
    process.close()


def dragged(page: Any, start: list[float], by: list[float], steps: int = 5) -> None:
    """Drag by pixels; the button stays down."""
    page.mouse.move(*start)
    page.mouse.down()
    for k in range(1, steps + 1):
        page.mouse.move(start[0] + by[0] * k / steps, start[1] + by[1] * k / steps)


def last(page: Steering, kind: str) -> Any:
    return [command for command in page.commands if command["type"] == kind][-1]


def test_hand_ball_and_elbow(browser: Any, played: Played, tmp_path: Path) -> None:
    """The hand comes within a millimetre of its target, the ball where it was put."""
    page, wrong = browsers.opened(browser, played.url, **SMALL)
    until(page, READY)
    page.evaluate(SHADOW)  # without it a picture takes half the time
    before = page.evaluate("play.gizmos.get('target hand').position.toArray()")
    start = page.evaluate(HAND)
    dragged(page, start, [60.0, -45.0])
    page.mouse.up()
    dragged(page, page.evaluate(BALL), [-30.0, 20.0])
    page.mouse.up()
    begin = page.evaluate("play.state.t")
    until(page, f"play.state.t > {begin} + 3")
    target = page.evaluate("play.gizmos.get('target hand').position.toArray()")
    assert np.linalg.norm(np.subtract(target, before)) > 0.03
    there = np.subtract(page.evaluate(HAND), start)
    np.testing.assert_allclose(there, [60.0, -45.0], atol=1.0)  # pixels of 3 mm
    ball = page.evaluate("play.obstacles.get('obstacle ball').at.toArray()")
    dragged(page, page.evaluate(ELBOW), [0.0, 60.0])
    until(page, "play.force !== null && play.force.newtons > 1")
    page.mouse.up()
    until(page, "play.force === null")
    begin = page.evaluate("play.state.t")
    until(page, f"play.state.t > {begin} + 3")
    page.keyboard.press("s")
    until(page, "play.state.message.startsWith('saved: ')")
    page.close()
    assert wrong == []
    log = hsp.Rollout.load(tmp_path / "panda-play.npz")
    hand = log["task.hand.actual"][-1, :3]
    np.testing.assert_allclose(hand, target, atol=1e-3)
    np.testing.assert_allclose(log["obstacle.ball"][-1], ball, atol=1e-6)
    moved = np.abs(np.diff(log["obstacle.ball"], axis=0)).max()
    assert moved < 0.0055  # half a metre a second: it went there
    played.end()
    assert played.process.returncode == 0


@pytest.mark.skipif(not THOROUGH, reason="takes most of a minute: make thorough")
def test_a_page_closed_in_a_drag_and_one_that_stalls(
    browser: Any, played: Played
) -> None:
    page, _ = browsers.opened(browser, played.url, **SMALL)
    until(page, READY)
    page.evaluate(SHADOW)
    watching = Steering(played.url)
    wait_until(lambda: watching.drives() == (False, True))
    dragged(page, page.evaluate(HAND), [40.0, 0.0])
    # It draws nothing for three seconds; the loop goes on for all others.
    wait_until(lambda: any(c["type"] == "play_state" for c in watching.commands))
    begin = last(watching, "play_state")["t"]
    page.evaluate("""() => { const end = performance.now() + 3000;
                             while (performance.now() < end); }""")
    assert last(watching, "play_state")["t"] > begin + 0.2
    page.close()  # with the button down
    wait_until(lambda: watching.drives() == (False, False))
    begin = last(watching, "play_state")["t"]
    wait_until(lambda: last(watching, "play_state")["t"] > begin + 1.0)
    where = last(watching, "play_targets")["poses"]["hand"]
    wait_until(lambda: last(watching, "play_state")["t"] > begin + 1.5)
    still = last(watching, "play_targets")["poses"]["hand"]
    np.testing.assert_allclose(where, still, atol=1e-9)
    second, wrong = browsers.opened(browser, played.url, **SMALL)
    until(second, READY)
    until(second, "play.mine")
    second.close()
    assert wrong == []


def test_a_hostile_page_reaches_nothing(
    browser: Any, played: Played, tmp_path: Path
) -> None:
    """A page of another origin that even knows the key; and one without it."""
    served = tmp_path / "site"
    served.mkdir()
    (served / "index.html").write_text("<!DOCTYPE html><title>evil</title>")

    class Quiet(http.server.SimpleHTTPRequestHandler):
        def __init__(self, *arguments: Any) -> None:
            super().__init__(*arguments, directory=str(served))

        def log_message(self, *_: Any) -> None:
            pass

    site = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Quiet)
    threading.Thread(target=site.serve_forever, daemon=True).start()
    page, _ = browsers.opened(browser, f"http://127.0.0.1:{site.server_port}/")
    scene = played.url.replace("http", "ws").replace("/?", "/scene?")
    ended = page.evaluate(
        """(address) => new Promise((done) => {
          const socket = new WebSocket(address);
          socket.onopen = () => done("open");
          socket.onclose = () => done("closed");
        })""",
        scene,
    )
    assert ended == "closed"
    page.close()
    site.shutdown()
    site.server_close()
    without = browser.new_page()
    answer = without.goto(played.url.split("?")[0])
    assert answer.status == 403
    without.close()
