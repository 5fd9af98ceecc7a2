"""A clip: an animation of the scene's nodes, played by the page's player."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.bands import Band
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    clip_command,
    forget_clip,
    typed_array,
)


class Track(NamedTuple):
    """The animation of one property of one node."""

    path: str
    # ``position`` [m], ``quaternion`` (x, y, z, w), ``scale``, ``color``, ``opacity``,
    # ``visible`` or ``length``; see ``page/player.js``.
    property: str
    times: Array  # times [s], ascending, (n,)
    values: Array  # one row per time, (n, k)


class Clip(NamedTuple):
    """The animation of the scene from a start to an end."""

    start: float  # first time that can be shown [s]
    end: float  # last time that can be shown [s]
    tracks: list[Track]
    horizon: float | None = None  # the end of the complete clip [s]; None: ``end``
    bands: Sequence[Band] = ()  # what the time line marks

    @property
    def open(self) -> bool:
        """Whether an extension is expected."""
        return self.horizon is not None and self.horizon > self.end


def set_clip(
    clip: Clip,
    *,
    play: bool = False,
    loop: bool = False,
    speed: float = 1.0,
    keep: bool = False,
) -> list[Command]:
    """Return the commands that replace the current clip."""
    begin = clip_command(
        "clip",
        "begin",
        **_fields(clip),
        begins=True,
        play=play,
        loop=loop,
        speed=float(speed),
        keep=keep,
    )
    return [forget_clip(), begin]


def remove_clip() -> list[Command]:
    """Return the commands that remove the clip; then commands move the scene."""
    return [forget_clip(), clip_command("still", "begin")]


def extend_clip(clip: Clip, number: int) -> Command:
    """Return the command that appends a clip to the current one."""
    return clip_command("clip", f"more {number}", **_fields(clip), begins=False)


def _fields(clip: Clip) -> Json:
    clocks = _clocks(clip.tracks)
    numbers = {id(clock): number for number, clock in enumerate(clocks)}
    return {
        "start": float(clip.start),
        "end": float(clip.end),
        "horizon": float(clip.end if clip.horizon is None else clip.horizon),
        "open": clip.open,
        "clocks": [typed_array(clock, np.float64) for clock in clocks],
        "tracks": [
            {
                "path": track.path,
                "property": track.property,
                "clock": numbers[id(track.times)],
                "values": typed_array(track.values, np.float32),
            }
            for track in clip.tracks
        ],
        "bands": [band._asdict() for band in clip.bands],
    }


def _clocks(tracks: Iterable[Track]) -> list[Array]:
    """Return the distinct arrays of times of the tracks."""
    return list({id(track.times): track.times for track in tracks}.values())
