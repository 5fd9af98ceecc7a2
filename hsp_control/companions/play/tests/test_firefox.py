"""`hsp play` in Firefox, where it is installed: mouse, keys, and three windows."""

import asyncio
from pathlib import Path

import firefox
import numpy as np
import pytest
from places import further
from played import Played

READY = "typeof play !== 'undefined' && play.ready && play.state.t > 0"
ERRORS = "viewer.renderer.getContext().getError()"
COLOURS = """(() => {
  viewer.render();
  const {width, height} = viewer.renderer.domElement;
  const gl = viewer.renderer.getContext(), row = new Uint8Array(4 * width);
  gl.readPixels(0, height >> 1, width, 1, gl.RGBA, gl.UNSIGNED_BYTE, row);
  return new Set(row).size;
})()"""
BAR = """(() => {
  const {left, right} = part(".play-bar").getBoundingClientRect();
  return [left, right, viewer.dom_element.clientWidth];
})()"""
HAND = """(() => {
  const {x, y} = play.sight.update().project(play.gizmos.get("target hand").position);
  return [x, y, viewer.dom_element.clientWidth, viewer.dom_element.clientHeight];
})()"""
TARGET = "play.gizmos.get('target hand').position.toArray()"
SIZES = (1280, 800, 1.0), (1000, 640, 2.0), (390, 844, 2.0)


@pytest.mark.slow
@pytest.mark.process
@pytest.mark.browser
@pytest.mark.skipif(not firefox.is_installed(), reason="needs firefox-esr and Xvfb")
@pytest.mark.parametrize("robot", further("planar3r"))
def test_firefox_draws_a_play_in_windows_of_three_sizes(
    robot: str, tmp_path: Path
) -> None:
    played = Played(robot, "--out", str(tmp_path), "--port", "7091")
    profile = tmp_path / "profile"
    profile.mkdir()

    async def look() -> None:
        async with firefox.started(profile) as page:
            await page.resize(*SIZES[0])
            await page.open(played.url)
            await page.until(READY)
            for width, height, ratio in SIZES:
                await page.resize(width, height, ratio)
                await page.until(f"innerWidth === {width} && barHeight >= 0")
                left, right, end = await page.evaluate(BAR)
                assert (left >= 0, right <= end) == (True, True), width
                x, y, across, down = await page.evaluate(HAND)
                assert 0 < x < across, width
                assert 0 < y < down, width
                assert await page.evaluate(COLOURS) > 10, width
                assert await page.evaluate(ERRORS) == 0, width
                before = await page.evaluate(TARGET)
                await page.drag(x, y, -30.0, -20.0)
                after = await page.evaluate(TARGET)
                assert np.linalg.norm(np.subtract(after, before)) > 0.02, width
            await page.press("o")
            await page.until("play.law === 'no field'")
            await page.press(" ")
            await page.until("!play.state.running")
            assert (await page.picture()).startswith(b"\x89PNG")
            assert page.wrong == []

    try:
        asyncio.run(look())
    finally:
        played.close()
