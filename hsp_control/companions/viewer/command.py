"""The pages of `hsp`: ``view``, ``export`` and ``run --view``, and their options.

Slow modules are imported when they run.
"""

import argparse
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from hsp_control.cli.options import (
    AddedCommand,
    CommandPage,
    add_import,
    add_strict,
    loaded,
)
from hsp_control.common.errors import ViewerError

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun


def _add_view_options(view: argparse.ArgumentParser) -> None:
    view.add_argument(
        "logs",
        nargs="+",
        type=Path,
        metavar="LOG",
        help="a log of hsp run, live or play, or of Python",
    )
    where = view.add_mutually_exclusive_group()
    where.add_argument(
        "--beside",
        action="store_true",
        default=None,
        help="show several side by side; the default where their robots differ",
    )
    where.add_argument(
        "--overlay",
        action="store_false",
        dest="beside",
        help="show several over each other, all but the first as ghosts",
    )
    view.add_argument(
        "--speed",
        type=float,
        metavar="X",
        help="playback speed, 1 is real time; default: the log's",
    )
    view.add_argument(
        "--loop",
        action=argparse.BooleanOptionalAction,
        default=None,
        help="repeat the run; default: as in the log",
    )
    add_page(view)
    add_import(view)
    add_strict(view)


def _view(options: argparse.Namespace) -> int:
    from hsp_control.companions.viewer.pages import show_logs

    show_logs(options)
    return 0


VIEW = AddedCommand(
    help="play logs in a browser, one or several together",
    add_options=_add_view_options,
    run=_view,
    own_interrupts=True,  # it closes a page
    place=-3,
)


class ExportFormat(NamedTuple):
    """Formats of ``hsp export`` for one run: an entry point of ``hsp_control.exports``.

    Attributes:
        what: The name of such a file in a message, as in "a film".
        files: A description of each file ending; the endings are the names of options.
        add_options: Adds the other options to the parser of `hsp export`.
        write: Writes a file and returns its path, given the run, the path, the options
        and a callback for the completed share.
    """

    what: str
    files: Mapping[str, str]
    add_options: Callable[[argparse.ArgumentParser], object]
    write: Callable[
        ["ComparedRun", Path, argparse.Namespace, Callable[[float], None]], Path
    ]


def export_formats() -> list[ExportFormat]:
    """Return the formats that companions and other packages add to `hsp export`."""
    return [each for _, each in loaded("exports")]


def _add_export_options(export: argparse.ArgumentParser) -> None:
    export.add_argument(
        "logs",
        type=Path,
        nargs="+",
        metavar="LOG",
        help="written by hsp run; several logs make one page with a switch",
    )
    add_import(export)
    add_strict(export)
    export.add_argument(
        "--html",
        type=Path,
        metavar="FILE",
        help="a page that plays offline, with the plots",
    )
    for added in export_formats():
        for ending, text in added.files.items():
            export.add_argument(f"--{ending}", type=Path, metavar="FILE", help=text)
        added.add_options(export)


def _export(options: argparse.Namespace) -> int:
    from hsp_control.companions.viewer.pages import export

    added = [(end, each) for each in export_formats() for end in each.files]
    return export(options, {end: (each.what, each.write) for end, each in added})


EXPORT = AddedCommand(
    help="write logs as a page, or one as a film",
    add_options=_add_export_options,
    run=_export,
    own_interrupts=True,  # it closes a browser
    place=-1,
)


def _add_run_options(run: argparse.ArgumentParser) -> None:
    run.add_argument(
        "--view",
        action=argparse.BooleanOptionalAction,
        default=False,
        help="show the run in a browser, while it is computed and after",
    )
    add_page(run)


def _open(options: argparse.Namespace, *about: Any) -> AbstractContextManager[Any]:
    if not options.view:
        if options.port is not None:
            raise ViewerError("--port is that of a page: it needs --view")
        return nullcontext()
    from hsp_control.companions.viewer.pages import Screen

    return Screen.open(options, *about)


RUN_PAGE = CommandPage(add_options=_add_run_options, open=_open)


def add_page(parser: argparse.ArgumentParser) -> None:
    """Add the options for a page's port, and for opening it."""
    parser.add_argument(
        "--port",
        type=int,
        metavar="N",
        help="the page's port on this machine; default: the first free one from 7000",
    )
    parser.add_argument(
        "--browser",
        action=argparse.BooleanOptionalAction,
        default=True,
        help="open the page in a browser; its address is printed in any case",
    )
