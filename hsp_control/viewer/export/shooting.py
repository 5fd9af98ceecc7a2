"""Pictures of a page, each of exactly its moment."""

import base64
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from hsp_control.arrays import Array
from hsp_control.exceptions import ExportError

if TYPE_CHECKING:
    from playwright.sync_api import Page

_MOST_FRAMES = 100_000

_PREPARE = """(plots) => {
  player.pause();
  document.body.classList.add("film");
  document.body.classList.toggle("alone", !plots);
  const clock = () => words.time({text: `t = ${player.time.toFixed(2)} s`});
  player.addEventListener("time", clock);
}"""

# Seek, draw, and wait until what was drawn is what a screenshot shows: without the two
# frames it may show the moment before.
_SHOW = """(time) => {
  player.seek(time);
  viewer.render();
  return new Promise((shown) =>
    requestAnimationFrame(() => requestAnimationFrame(() => shown(player.time))));
}"""


def frame_times(times: Array, frame_rate: float, speed: float) -> Array:
    """Return the moments of the run that a film shows [s], the first one its start.

    Args:
        times: Of the log [s], shape (N,).
        frame_rate: Pictures in a second [Hz].
        speed: Seconds of the run in one second of the film.

    Raises:
        ExportError: If they are more than anyone would want.
    """
    count = int((times[-1] - times[0]) * frame_rate / speed + 1e-9) + 1
    if count > _MOST_FRAMES:
        raise ExportError(f"the film would have {count} pictures: raise the speed")
    return np.asarray(times[0] + np.arange(count) * speed / frame_rate)


def pictures(page: "Page", times: Array, plots: bool) -> Iterator[bytes]:
    """Yield pictures of moments, as PNG files.

    Args:
        page: An exported page that shows its scene.
        times: The moments [s], shape (N,).
        plots: Whether the plots are in the picture.
    """
    page.evaluate(_PREPARE, plots)
    page.evaluate(_SHOW, float(times[0]))  # sizes change only with the next frame
    camera = page.context.new_cdp_session(page)
    for time in times:
        page.evaluate(_SHOW, float(time))
        shot = camera.send(
            "Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True}
        )
        yield base64.b64decode(shot["data"])
