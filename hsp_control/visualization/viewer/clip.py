"""A clip: what the nodes of the scene do in time, for the page's player to play."""

from collections.abc import Iterable
from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.visualization.viewer.commands import (
    Command,
    Json,
    clip_command,
    forget_clip,
    typed_array,
)


class Track(NamedTuple):
    """What one property of one node does.

    Attributes:
        path: The node.
        property: ``position`` [m], ``quaternion`` (x, y, z, w), ``scale``, ``color``,
            ``opacity``, ``visible`` or ``length``; see ``page/player.js``.
        times: When [s], ascending, shape (n,).
        values: What, a row a time, shape (n, k).
    """

    path: str
    property: str
    times: Array
    values: Array


class Clip(NamedTuple):
    """What the scene does from a start to an end.

    Attributes:
        start: First time that can be shown [s].
        end: Last time that can be shown [s].
        tracks: What moves.
        horizon: Where the clip will end when it is whole [s]; None: at ``end``.
    """

    start: float
    end: float
    tracks: list[Track]
    horizon: float | None = None

    @property
    def open(self) -> bool:
        """Whether more of it is to come."""
        return self.horizon is not None and self.horizon > self.end


def set_clip(
    clip: Clip,
    *,
    play: bool = False,
    loop: bool = False,
    speed: float = 1.0,
    keep: bool = False,
) -> list[Command]:
    """Return the commands that show a clip in place of the last one.

    Args:
        clip: The clip.
        play: Begin to play at once.
        loop: Play it again and again.
        speed: Seconds of the clip in one second.
        keep: If another clip is shown, go on at its time, as it was played.
    """
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


def no_clip() -> list[Command]:
    """Return the commands that take the clip away: others move the scene from now."""
    return [forget_clip(), clip_command("still", "begin")]


def extend_clip(clip: Clip, number: int) -> Command:
    """Return the command that adds what comes after the last clip's end.

    Args:
        clip: What comes.
        number: How many came before it since `set_clip`.
    """
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
    }


def _clocks(tracks: Iterable[Track]) -> list[Array]:
    """Return the times that tracks follow; those that several share, once."""
    return list({id(track.times): track.times for track in tracks}.values())
