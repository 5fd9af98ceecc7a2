"""Films as formats of ``hsp export``."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from hsp_control.companions.viewer.command import ExportFormat

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun


def _add_options(export: argparse.ArgumentParser) -> None:
    export.add_argument(
        "--size",
        type=_picture_size,
        metavar="WxH",
        help="of films [pixels]; default: 1280x720, of GIF and WebP 800x450",
    )
    export.add_argument(
        "--fps",
        type=float,
        metavar="N",
        help="frames per second of films; default: 30, of GIF and WebP 20",
    )
    export.add_argument(
        "--speed",
        type=float,
        default=1.0,
        metavar="X",
        help="playback speed of films, 1 is real time; default: 1",
    )
    for name, which in (("from", "first"), ("to", "last")):
        export.add_argument(
            f"--{name}",
            type=float,
            dest=which,
            metavar="T",
            help=f"the {which} moment of films [s]; default: the run's",
        )
    for name in ("plots", "caption"):
        export.add_argument(
            f"--{name}",
            action=argparse.BooleanOptionalAction,
            default=True,
            help=f"show the {name} in films; default: yes",
        )


def _write(
    run: "ComparedRun",
    path: Path,
    options: argparse.Namespace,
    progress: Callable[[float], None],
) -> Path:
    from hsp_control.companions.film.film import FilmStyle, export_film

    style = FilmStyle(
        size=options.size,
        frame_rate=options.fps,
        speed=options.speed,
        plots=options.plots,
        caption=options.caption,
        start=options.first,
        end=options.last,
    )
    return export_film(
        run.rollout,
        path,
        style=style,
        robot=run.robot,
        controller=run.controller,
        progress=progress,
    )


def _picture_size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, as 1280x720")
    return int(width), int(height)


FILM = ExportFormat(
    what="a film",
    files={
        "mp4": "a film",
        "gif": "an animated GIF",
        "webp": "an animated WebP: smaller than a GIF, in all its colours",
    },
    add_options=_add_options,
    write=_write,
)
