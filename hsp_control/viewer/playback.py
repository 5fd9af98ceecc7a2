"""A run at its own pace: what cannot be drawn in time is left out."""

import logging
import time
from collections.abc import Callable
from typing import NamedTuple

from hsp_control.exceptions import ViewerError

FRAME_RATE = 60.0  # Hz
_SMOOTH = 20.0  # Hz: below, motion is not seen as motion

_log = logging.getLogger(__name__)


class Playback(NamedTuple):
    """How playing went.

    Attributes:
        frames: Frames drawn.
        seconds: How long it took [s].
    """

    frames: int
    seconds: float

    @property
    def rate(self) -> float:
        """Frames drawn in a second [Hz]."""
        return self.frames / self.seconds if self.seconds else FRAME_RATE


def play(
    draw: Callable[[float], None], start: float, end: float, speed: float
) -> Playback:
    """Draw a run from its start to its end, in real time or at another speed.

    A line in the log says so if it cannot be drawn smoothly.

    Args:
        draw: Draws the run at a time [s].
        start: First time [s].
        end: Last time [s].
        speed: Seconds of the run shown in one second.

    Raises:
        ViewerError: If the speed is not positive.
    """
    if not 0.0 < speed < float("inf"):
        raise ViewerError(f"speed {speed} must be positive")
    begin = time.perf_counter()
    frames = 0
    now = start
    while now < end:
        draw(now)
        frames += 1
        elapsed = time.perf_counter() - begin
        # Frames begin at whole multiples of their period: those missed are left out.
        tick = (int(elapsed * FRAME_RATE) + 1) / FRAME_RATE
        time.sleep(tick - elapsed)
        now = start + tick * speed
    draw(end)
    playback = Playback(frames + 1, time.perf_counter() - begin)
    if playback.rate < _SMOOTH and playback.seconds > 1.0:
        _log.warning(
            "the view cannot keep up: %.0f frames a second of %.0f",
            playback.rate,
            FRAME_RATE,
        )
    return playback
