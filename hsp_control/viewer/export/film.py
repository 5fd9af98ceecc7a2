"""From a run to a film, without a display: the page, moment by moment."""

import base64
from collections.abc import Callable
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from hsp_control.arrays import Array
from hsp_control.config.models.view import ViewModel
from hsp_control.exceptions import ExportError
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout
from hsp_control.suggest import did_you_mean
from hsp_control.viewer.export.chromium import headless_browser, open_page
from hsp_control.viewer.export.encoding import FORMATS, encoder, find_ffmpeg
from hsp_control.viewer.export.html import export_html

if TYPE_CHECKING:
    from playwright.sync_api import CDPSession, Page

_SMALLEST, _LARGEST = 64, 7680
_MOST_FRAMES = 100_000

# Seek, draw, and wait until what was drawn is what a screenshot shows: without the two
# frames it may show the moment before.
_SHOW = """(time) => {
  player.seek(time);
  viewer.render();
  return new Promise((shown) =>
    requestAnimationFrame(() => requestAnimationFrame(() => shown(player.time))));
}"""


class FilmStyle(NamedTuple):
    """How a film is taken.

    Attributes:
        size: Width and height [pixels]; None: 1280 x 720, of a GIF or WebP 800 x 450.
        frame_rate: Pictures in a second [Hz]; None: 30, of a GIF or WebP 20.
        speed: Seconds of the run in one second of the film.
        plots: Whether the plots are in the picture.
    """

    size: tuple[int, int] | None = None
    frame_rate: float | None = None
    speed: float = 1.0
    plots: bool = True


def export_film(
    rollout: Rollout,
    path: str | Path,
    *,
    style: FilmStyle | None = None,
    robot: Robot | None = None,
    settings: ViewModel | None = None,
    progress: Callable[[float], None] | None = None,
) -> Path:
    """Write a film of a run: MP4, GIF or animated WebP, by the file's ending.

    Every picture shows exactly its moment, however slow the machine is; the same run
    gives the same pictures again.

    Args:
        rollout: The run.
        path: The file to write.
        style: Size, pace and what is in the picture.
        robot: See `export_html`.
        settings: See `export_html`.
        progress: Told the share that is done, from 0 to 1.

    Raises:
        ViewerError: See `export_html`.
        ExportError: If the style cannot be, playwright, a browser or ffmpeg is missing,
            one of them fails, or the file cannot be written.
    """
    path = Path(path)
    still = path.suffix.lower() in {".gif", ".webp"}
    style = style or FilmStyle()
    size = style.size or ((800, 450) if still else (1280, 720))
    frame_rate = style.frame_rate or (20.0 if still else 30.0)
    _check(path, size, frame_rate, style.speed)
    find_ffmpeg()  # what is missing is said before the work, not after
    times = frame_times(rollout.t, frame_rate, style.speed)
    with headless_browser() as browser, TemporaryDirectory() as folder:
        page_file = Path(folder) / "page.html"
        export_html(rollout, page_file, robot=robot, settings=settings)
        with encoder(path, frame_rate) as take:
            page = open_page(browser, page_file, size)
            camera = _prepare(page, style)
            for number, time in enumerate(times, start=1):
                take(_picture(page, camera, float(time)))
                if progress is not None:
                    progress(number / len(times))
    return path


def frame_times(times: Array, frame_rate: float, speed: float) -> Array:
    """Return the moments of the run that a film shows [s], the first one its start.

    Raises:
        ExportError: If they are more than anyone would want.
    """
    count = int((times[-1] - times[0]) * frame_rate / speed + 1e-9) + 1
    if count > _MOST_FRAMES:
        raise ExportError(f"the film would have {count} pictures: raise the speed")
    return np.asarray(times[0] + np.arange(count) * speed / frame_rate)


def _prepare(page: "Page", style: FilmStyle) -> "CDPSession":
    page.evaluate(
        """(plots) => {
          player.pause();
          document.body.classList.add("film");
          document.body.classList.toggle("alone", !plots);
          const clock = () => words.time({text: `t = ${player.time.toFixed(2)} s`});
          player.addEventListener("time", clock);
        }""",
        style.plots,
    )
    page.evaluate(_SHOW, 0.0)  # sizes change only with the next frame
    return page.context.new_cdp_session(page)


def _picture(page: "Page", camera: "CDPSession", time: float) -> bytes:
    """Return the picture of a moment [s], as a PNG file."""
    page.evaluate(_SHOW, time)
    shot = camera.send(
        "Page.captureScreenshot", {"format": "png", "optimizeForSpeed": True}
    )
    return base64.b64decode(shot["data"])


def _check(path: Path, size: tuple[int, int], frame_rate: float, speed: float) -> None:
    if path.suffix.lower() not in FORMATS:
        raise ExportError(
            f"{path}: a film ends with one of {', '.join(FORMATS)}"
            f"{did_you_mean(path.suffix, FORMATS)}"
        )
    if not all(_SMALLEST <= edge <= _LARGEST for edge in size):
        raise ExportError(
            f"a film of {size[0]}x{size[1]} pixels: each must be between {_SMALLEST} "
            f"and {_LARGEST}"
        )
    if not 1.0 <= frame_rate <= 240.0:
        raise ExportError(f"{frame_rate:g} pictures in a second: must be 1 to 240")
    if not 0.0 < speed < float("inf"):
        raise ExportError(f"speed {speed:g} must be positive")
