"""Exports a run to a film; needs no display."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Event
from typing import Any, NamedTuple

from hsp_control.common.errors import ExportError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.companions.film.chromium import headless_browser, open_page
from hsp_control.companions.film.encoding import FORMATS, encoder, find_ffmpeg
from hsp_control.companions.film.screenshots import frame_times, screenshots
from hsp_control.companions.viewer.export_page import export_html
from hsp_control.control.interface import Controller
from hsp_control.robot import Robot
from hsp_control.simulation import Rollout

_MIN_SIZE, _MAX_SIZE = 64, 7680


class FilmStyle(NamedTuple):
    """The settings of a film.

    Attributes:
        size: Width and height [pixels]; None: 1280 x 720, of a GIF or WebP 800 x 450.
        frame_rate: Images per second [Hz]; None: 30, of a GIF or WebP 20.
        speed: Seconds of the run per second of the film.
        plots: Whether the plots are shown.
        caption: Whether title, clock and legend are shown.
        start: First time of the run that is shown [s]; None: the run's start.
        end: Last time of the run that is shown [s]; None: the run's end.
    """

    size: tuple[int, int] | None = None
    frame_rate: float | None = None
    speed: float = 1.0
    plots: bool = True
    caption: bool = True
    start: float | None = None
    end: float | None = None


def export_film(
    rollout: Rollout,
    path: str | Path,
    *,
    style: FilmStyle | None = None,
    robot: Robot | None = None,
    controller: Controller | None = None,
    progress: Callable[[float], None] | None = None,
    **view: Any,
) -> Path:
    """Write a film of a run: MP4, GIF or animated WebP, by the file's extension.

    Every image shows exactly its time, however slow the machine is; the same run gives
    the same images.

    Args:
        rollout: The run.
        path: The file to write.
        style: Size, speed and contents.
        robot: See `export_html`.
        controller: See `export_html`.
        progress: Called with the completed share, from 0 to 1, from another thread.
        view: See `export_html`.

    Raises:
        ViewerError: See `export_html`.
        ExportError: If the style is not valid, if playwright, a browser or ffmpeg is
            missing or fails, or if the file cannot be written.
    """
    path = Path(path)
    style = style or FilmStyle()
    size, frame_rate = _checked_format(path, style)
    times = frame_times(_span(rollout, style), frame_rate, style.speed)
    find_ffmpeg()  # raise before the work, not after it
    stopped = Event()

    def record() -> None:
        with headless_browser() as browser, TemporaryDirectory() as folder:
            file = Path(folder) / "page.html"
            export_html(rollout, file, robot=robot, controller=controller, **view)
            page = open_page(browser, file, size)
            with encoder(path, frame_rate) as write:
                for number, image in enumerate(
                    screenshots(page, times, plots=style.plots, caption=style.caption),
                    start=1,
                ):
                    write(image)
                    if stopped.is_set():
                        raise ExportError(f"{path}: stopped")
                    if progress is not None:
                        progress(number / len(times))

    # The browser's driver must not run in a thread with an event loop, as notebooks
    # have one.
    with ThreadPoolExecutor(1) as other_thread:
        try:
            other_thread.submit(record).result()
        except BaseException:
            stopped.set()
            raise
    return path


def _checked_format(path: Path, style: FilmStyle) -> tuple[tuple[int, int], float]:
    """Return size and frame rate; raise if the style is not valid."""
    if path.suffix.lower() not in FORMATS:
        raise ExportError(
            f"{path}: the extension of a film must be one of {', '.join(FORMATS)}"
            f"{did_you_mean(path.suffix, FORMATS)}"
        )
    light = path.suffix.lower() != ".mp4"
    size = style.size or ((800, 450) if light else (1280, 720))
    frame_rate = style.frame_rate
    if frame_rate is None:
        frame_rate = 20.0 if light else 30.0
    if not all(_MIN_SIZE <= edge <= _MAX_SIZE for edge in size):
        raise ExportError(
            f"a film of {size[0]}x{size[1]} pixels: width and height must be between "
            f"{_MIN_SIZE} and {_MAX_SIZE}"
        )
    if not 1.0 <= frame_rate <= 240.0:
        raise ExportError(f"frame rate {frame_rate:g} Hz: must be between 1 and 240")
    if not 0.0 < style.speed < float("inf"):
        raise ExportError(f"speed {style.speed:g} must be positive")
    return size, frame_rate


def _span(rollout: Rollout, style: FilmStyle) -> tuple[float, float]:
    """Return the first and the last time that the film shows [s]."""
    first, last = (float(t) for t in rollout.t[[0, -1]]) if len(rollout) else (0.0, 0.0)
    start = first if style.start is None else style.start
    end = last if style.end is None else style.end
    if not first <= start <= end <= last:
        raise ExportError(
            f"a film from {start:g} to {end:g} s: must lie within the run, "
            f"{first:g} to {last:g} s"
        )
    return start, end
