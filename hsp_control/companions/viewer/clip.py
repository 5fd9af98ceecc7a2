"""A clip: an animation that the page plays, and the bands on its time line."""

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from hsp_control.companions.plots import palette
from hsp_control.companions.plots.analysis import acts, from_the_start
from hsp_control.companions.plots.log_series import spans_of
from hsp_control.companions.viewer.commands import (
    CLIP,
    Json,
    PageCommand,
    forget_clip,
    page_command,
    typed_array,
)
from hsp_control.companions.viewer.motion import Track
from hsp_control.control.interface import Controller
from hsp_control.null_space.fields import Clearance, NullSpaceField, SelfClearance
from hsp_control.simulation import Rollout
from hsp_control.simulation.limit_excess import POSITION, VELOCITY
from hsp_control.simulation.log_columns import logged_terms
from hsp_control.simulation.measures import FAR, LIMITED, OUT, Unreached, unreached

CLOSED_SHARE = 1 / 200
"""Gaps up to this share of the whole run are closed: they would be invisible."""
_SAME = 0.9
"""If the smallest distance is at least this share of the largest, one is reported."""


class Band(NamedTuple):
    """The times at which something that affects the law is active."""

    name: str  # its name before a time, such as ``limit active``
    caption: str  # text while the time is inside: ``a limit is active``
    color: str  # its colour, ``#RRGGBB``
    spans: list[tuple[float, float]]  # its intervals [s], ascending and apart
    run: str = ""  # in a comparison, the name of its run

    def of_run(self, run: str) -> "Band":
        """Return it as a band of one run of several, with the run's name."""
        name, caption = f"{run}: {self.name}", f"{run}: {self.caption}"
        return self._replace(run=run, name=name, caption=caption)


def bands_of(
    rollout: Rollout, controller: Controller | None, *, duration: float | None = None
) -> list[Band]:
    """Return the bands of a run, without those that have no interval."""
    times = rollout.t
    whole = float(times[-1] - times[0]) if duration is None else duration
    bands = [
        band._replace(spans=spans_of(times, active, CLOSED_SHARE * whole))
        for band, active in _activities(rollout, controller)
    ]
    return [band for band in bands if band.spans]


def _activities(
    rollout: Rollout, controller: Controller | None
) -> Iterator[tuple[Band, NDArray[np.bool_]]]:
    """Yield the bands without intervals, and the rows in which they are active."""
    if "status" in rollout:
        limit = Band("limit active", "a limit is active", palette.DESIRED, [])
        yield limit, rollout["status"] >= LIMITED
    beyond = np.zeros(len(rollout), bool)
    for name in (POSITION, VELOCITY):
        if name in rollout:
            beyond |= (rollout[name] > 0.0).any(axis=1)
    words = "beyond a limit"
    yield Band(words, f"a joint is {words}", palette.MUTED, []), beyond
    for task in unreached(rollout.columns, rollout.meta.get("tasks", {})):
        name = f"{task.task}: {FAR}"
        yield Band(name, name, palette.SERIES[2], []), task.far
        yield _out_of_reach(task), task.out > 0.0
    if "damped" in rollout:
        words = "bounded at a singularity"
        singular = Band(words, f"the law is {words}", palette.WARNING, [])
        yield singular, rollout["damped"] > 0.0
    obstacle = itself = np.zeros(len(rollout), bool)
    deepest = np.full(len(rollout), np.inf)
    for name, field in _fields_of(controller, rollout).items():
        if isinstance(field, Clearance) and f"distance.{name}" in rollout:
            distance = rollout[f"distance.{name}"]
            deepest = np.minimum(deepest, distance)
            near = (distance < field.influence) & acts(field)
            if isinstance(field, SelfClearance):
                itself = itself | near
            else:
                obstacle = obstacle | near
    depth = f"collision, up to {-100.0 * deepest.min():.1f} cm deep"
    yield Band("collision", depth, palette.COLLISION, []), deepest < 0.0
    words = "inside an influence zone"
    yield Band(words, f"a link is {words}", palette.OBSTACLE, []), obstacle
    words = "links near each other"
    yield Band(words, words, palette.SERIES[4], []), itself


def _out_of_reach(task: Unreached) -> Band:
    """Return the band of a target out of reach; its label is the largest distance."""
    name, away = f"{task.task}: {OUT}", task.out[task.out > 0.0]
    varies = away.min(initial=np.inf) < _SAME * away.max(initial=0.0)
    length = ("up to " if varies else "") + task.length(int(task.out.argmax()))
    return Band(name, f"{name}, {length}", palette.SERIES[0], [])


def _fields_of(
    controller: Controller | None, run: Rollout
) -> dict[str, NullSpaceField]:
    """Return the fields at the run's start and now, by their names in the log."""
    if controller is None:
        return {}
    return logged_terms(from_the_start(controller, run)) | logged_terms(controller)


class Clip(NamedTuple):
    """The animation of the scene from a start to an end."""

    start: float  # first time that can be shown [s]
    end: float  # last time that can be shown [s]
    tracks: list[Track]
    horizon: float | None = None  # the end of the complete clip [s]; None: ``end``
    bands: Sequence[Band] = ()  # marks on the time line

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
) -> list[PageCommand]:
    """Return the commands that replace the current clip."""
    begin = page_command(
        "clip",
        CLIP,
        "begin",
        **_fields(clip),
        begins=True,
        play=play,
        loop=loop,
        speed=float(speed),
        keep=keep,
    )
    return [forget_clip(), begin]


def remove_clip() -> list[PageCommand]:
    """Return the commands that remove the clip; commands then move the scene."""
    return [forget_clip(), page_command("still", CLIP, "begin")]


def extend_clip(clip: Clip, number: int) -> PageCommand:
    """Return the command that appends a clip to the current one."""
    return page_command("clip", CLIP, f"more {number}", **_fields(clip), begins=False)


def track_fields(track: Track) -> Json:
    """Return a track in the page's form, without its times."""
    values = typed_array(track.values, np.float32)
    return {"path": track.path, "property": track.property, "values": values}


def _fields(clip: Clip) -> Json:
    clocks = list({id(track.times): track.times for track in clip.tracks}.values())
    numbers = {id(clock): number for number, clock in enumerate(clocks)}
    return {
        "start": float(clip.start),
        "end": float(clip.end),
        "horizon": float(clip.end if clip.horizon is None else clip.horizon),
        "open": clip.open,
        "clocks": [typed_array(clock, np.float64) for clock in clocks],
        "tracks": [
            {**track_fields(track), "clock": numbers[id(track.times)]}
            for track in clip.tracks
        ],
        "bands": [band._asdict() for band in clip.bands],
    }
