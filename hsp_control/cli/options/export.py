"""The options of ``hsp export``."""

import argparse
from pathlib import Path

from hsp_control.cli.options.shared import add_strict


def add_export(export: argparse.ArgumentParser) -> None:
    """Add all options of `hsp export`."""
    export.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="written by hsp run; several logs make one page with a switch",
    )
    add_strict(export)
    files = {
        "html": "a page that plays offline, with the plots",
        "mp4": "a film",
        "gif": "an animated GIF",
        "webp": "an animated WebP: smaller than a GIF, in all its colours",
        "rrd": "a file for Rerun's viewer; needs the extra rerun",
    }
    for name, text in files.items():
        export.add_argument(f"--{name}", type=Path, metavar="FILE", help=text)
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


def _picture_size(text: str) -> tuple[int, int]:
    width, _, height = text.lower().partition("x")
    if not (width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"{text!r} is not WIDTHxHEIGHT, as 1280x720")
    return int(width), int(height)
