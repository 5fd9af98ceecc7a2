"""Screenshots of a page at exact times of the run."""

import base64
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ExportError

if TYPE_CHECKING:
    from playwright.sync_api import Page

_MAX_FRAMES = 100_000

_PREPARE = """({plots, caption}) => {
  player.pause();
  document.body.classList.add("film");
  document.body.classList.toggle("alone", !plots);
  document.body.classList.toggle("bare", !caption);
  const clock = () => commandHandlers.time({text: `t = ${player.time.toFixed(2)} s`});
  player.addEventListener("time", clock);
  const end = document.getElementById("side").getBoundingClientRect().bottom;
  for (const plot of document.querySelectorAll("#side section")) {
    if (plot.getBoundingClientRect().bottom > end) plot.hidden = true;  // cut off
  }
}"""

# Seek, draw, and wait two frames: else a screenshot may show the previous time.
_SHOW = """(time) => {
  player.seek(time);
  viewer.render();
  return new Promise((shown) =>
    requestAnimationFrame(() => requestAnimationFrame(() => shown(player.time))));
}"""


def frame_times(span: tuple[float, float], frame_rate: float, speed: float) -> Array:
    """Return the times of the run that a film shows [s], shape (N,)."""
    start, end = span
    count = int((end - start) * frame_rate / speed + 1e-9) + 1
    if count > _MAX_FRAMES:
        raise ExportError(
            f"the film would have {count} images, at most {_MAX_FRAMES} are allowed: "
            "increase the speed"
        )
    return np.asarray(start + np.arange(count) * speed / frame_rate)


def screenshots(
    page: "Page", times: Array, *, plots: bool, caption: bool
) -> Iterator[bytes]:
    """Yield screenshots at given times, as PNG files."""
    page.evaluate(_PREPARE, {"plots": plots, "caption": caption})
    page.evaluate(_SHOW, float(times[0]))  # sizes change in the next frame
    camera = page.context.new_cdp_session(page)
    for time in times:
        page.evaluate(_SHOW, float(time))
        shot = camera.send(
            "Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True}
        )
        yield base64.b64decode(shot["data"])
