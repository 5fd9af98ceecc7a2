"""`hsp play` as used by hand: the program, a real browser, and a mouse."""

import socket
from collections.abc import Iterator
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit

import browsers
import numpy as np
import pytest
from browsers import until
from places import further
from played import Played

import hsp_control as hsp

SMALL = {"viewport": {"width": 800, "height": 500}}  # a frame takes less time
READY = "typeof play !== 'undefined' && play.ready && play.state.t > 0"
SHADOW = """[...document.querySelectorAll("#layers button")]
  .find((row) => row.textContent === "shadow").click()"""
HAND = """() => {
  const gizmo = play.gizmos.get("target hand");
  const {x, y} = play.sight.update().project(gizmo.position);
  return [x, y];
}"""
BALL = """() => {
  const {position} = play.gizmos.get("obstacle ball");
  const {x, y} = play.sight.update().project(position);
  return [x, y];
}"""
# Its highest pixel, in steps of 5: first in steps of 15, since a test is slow.
ELBOW = """() => {
  const {left, top, width, height} = play.sight.update().box;
  const first = (from, to, step) => {
    for (let y = from; y <= to; y += step) {
      for (let x = left; x < left + width; x += step) {
        const found = play.hand.find(x, y, "mouse");
        if (found?.path?.includes("panda_joint4")) return [x, y];
      }
    }
    return null;
  };
  const [, y] = first(top, top + height, 15);
  return first(Math.max(top, y - 10), y, 5);
}"""


@pytest.fixture
def played(robot: str, tmp_path: Path) -> Iterator[Played]:
    with socket.socket() as probe:  # reserved, so that no other test uses the port
        probe.bind(("127.0.0.1", 0))
        port = str(probe.getsockname()[1])
    process = Played(robot, "--out", str(tmp_path), "--port", port)
    yield process
    process.close()


def dragged(page: Any, start: list[float], by: list[float], steps: int = 5) -> None:
    """Drag by pixels; the button stays down."""
    page.mouse.move(*start)
    page.mouse.down()
    for k in range(1, steps + 1):
        page.mouse.move(start[0] + by[0] * k / steps, start[1] + by[1] * k / steps)


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.browser
@pytest.mark.parametrize("robot", further("panda"))
def test_hand_ball_and_elbow(browser: Any, played: Played, tmp_path: Path) -> None:
    """The hand comes within a millimetre of its target; the elbow ducks the ball."""
    page, wrong = browsers.opened(browser, played.url, **SMALL)
    until(page, READY)
    page.evaluate(SHADOW)  # without it a frame takes half the time
    before = page.evaluate("play.gizmos.get('target hand').position.toArray()")
    start = page.evaluate(HAND)
    dragged(page, start, [60.0, -45.0])
    page.mouse.up()
    ball = np.array(page.evaluate(BALL))
    dragged(page, ball, np.subtract(page.evaluate(ELBOW), ball))  # first, in the plane
    page.mouse.up()
    begin = page.evaluate("play.state.t")
    until(page, f"play.state.t > {begin} + 3")
    target = page.evaluate("play.gizmos.get('target hand').position.toArray()")
    assert np.linalg.norm(np.subtract(target, before)) > 0.03
    there = np.subtract(page.evaluate(HAND), start)
    np.testing.assert_allclose(there, [60.0, -45.0], atol=1.0)  # pixels of 3 mm
    ball = page.evaluate("play.gizmos.get('obstacle ball').position.toArray()")
    dragged(page, page.evaluate(ELBOW), [0.0, 60.0])
    until(page, "play.force !== null && play.force.newtons > 1")
    page.mouse.up()
    until(page, "play.force === null")
    begin = page.evaluate("play.state.t")
    until(page, f"play.state.t > {begin} + 3")
    page.keyboard.press("s")
    until(page, "play.state.message.startsWith('saved: ')")
    assert wrong == []
    log = hsp.Rollout.load(tmp_path / "panda-play.npz")
    hand = log["task.hand.actual"][-1, :3]
    np.testing.assert_allclose(hand, target, atol=1e-3)
    np.testing.assert_allclose(log["obstacle.ball"][-1], ball, atol=1e-6)
    moved = np.abs(np.diff(log["obstacle.ball"], axis=0)).max()
    assert moved < 0.0055  # half a metre per second: it followed
    # The ball moved at up to half a metre per second to the elbow's position; the
    # field's reaction depends on its weight: they may touch, more so if a loaded
    # machine delivers the drag at once, but the elbow ends clear of the ball.
    clearance = log["distance.obstacle_clearance"]
    assert clearance.min() > -0.05
    assert clearance[-1] > 0.02
    elbow = log["skeleton"][:, 3]
    assert np.linalg.norm(elbow[-1] - elbow[0]) > 0.1
    played.end()
    assert played.process.returncode == 0
    # The page reports it, and detects the next start.
    until(page, "document.getElementById('lost').textContent.includes('has ended')")
    assert page.evaluate("play.panel.fields.every((field) => field.disabled)")
    assert page.evaluate("play.bar.acting.every((button) => button.disabled)")
    port = urlsplit(played.url).port
    again = Played("planar3r", "--out", str(tmp_path), "--port", str(port))
    try:
        until(page, READY + " && !document.body.classList.contains('lost')")
    finally:
        again.close()
    page.close()
