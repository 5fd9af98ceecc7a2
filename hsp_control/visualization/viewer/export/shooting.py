"""Pictures of a page, each of exactly its moment."""

import base64
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import ExportError

if TYPE_CHECKING:
    from playwright.sync_api import Page

_MOST_FRAMES = 100_000

_PREPARE = """({plots, caption}) => {
  player.pause();
  document.body.classList.add("film");
  document.body.classList.toggle("alone", !plots);
  document.body.classList.toggle("bare", !caption);
  const clock = () => words.time({text: `t = ${player.time.toFixed(2)} s`});
  player.addEventListener("time", clock);
  const end = document.getElementById("side").getBoundingClientRect().bottom;
  for (const plot of document.querySelectorAll("#side section")) {
    if (plot.getBoundingClientRect().bottom > end) plot.hidden = true;  // it is cut
  }
}"""

# Seek, draw, and wait until what was drawn is what a screenshot shows: without the two
# frames it may show the moment before.
_SHOW = """(time) => {
  player.seek(time);
  viewer.render();
  return new Promise((shown) =>
    requestAnimationFrame(() => requestAnimationFrame(() => shown(player.time))));
}"""


def frame_times(span: tuple[float, float], frame_rate: float, speed: float) -> Array:
    """Return the moments of the run that a film shows [s], the first one its start.

    Args:
        span: The first and the last that may be shown [s].
        frame_rate: Pictures in a second [Hz].
        speed: Seconds of the run in one second of the film.

    Raises:
        ExportError: If they are more than anyone would want.
    """
    start, end = span
    count = int((end - start) * frame_rate / speed + 1e-9) + 1
    if count > _MOST_FRAMES:
        raise ExportError(f"the film would have {count} pictures: raise the speed")
    return np.asarray(start + np.arange(count) * speed / frame_rate)


def pictures(
    page: "Page", times: Array, *, plots: bool, caption: bool
) -> Iterator[bytes]:
    """Yield pictures of moments, as PNG files.

    Args:
        page: An exported page that shows its scene.
        times: The moments [s], shape (N,).
        plots: Whether the plots are in the picture.
        caption: Whether title, clock and legend are.
    """
    page.evaluate(_PREPARE, {"plots": plots, "caption": caption})
    page.evaluate(_SHOW, float(times[0]))  # sizes change only with the next frame
    camera = page.context.new_cdp_session(page)
    for time in times:
        page.evaluate(_SHOW, float(time))
        shot = camera.send(
            "Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True}
        )
        yield base64.b64decode(shot["data"])
