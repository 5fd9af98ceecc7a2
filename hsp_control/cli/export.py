"""``hsp export``: write logs as a page for offline use, or one as films."""

import argparse
import sys
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from hsp_control.cli.consoles import errors, out, working
from hsp_control.common.exceptions import ExportError

if TYPE_CHECKING:
    from hsp_control.visualization.viewer.comparison import ComparedRun

_LONGEST = 24
"""Longest title that is a name in the switch between runs."""


def export(options: argparse.Namespace) -> int:
    """Write every requested file; a file that fails does not stop the others."""
    from hsp_control.visualization.viewer.export import (
        FilmStyle,
        export_film,
        export_html,
    )
    from hsp_control.visualization.viewer.replay import access_for, load_runs

    films = [path for path in (options.mp4, options.gif, options.webp) if path]
    if not (options.html or options.rrd or films):
        raise ExportError(
            "nothing to write: give a file with --html, --mp4, --gif, --webp or --rrd"
        )
    for kind in ("mp4", "gif", "webp", "rrd"):
        _check_ending(getattr(options, kind), f".{kind}")
    if len(options.logs) > 1 and (films or options.rrd):
        raise ExportError(
            f"{'a film' if films else 'a file of Rerun'} shows one run, "
            f"{len(options.logs)} logs are given: give one log, "
            "or --html for a page with a switch between them"
        )
    strict = options.strict or bool(options.allow)
    access = access_for(options.logs, strict, options.allow)
    runs = _titled(load_runs(options.logs, access))
    run = runs[0]
    style = FilmStyle(
        size=options.size,
        frame_rate=options.fps,
        speed=options.speed,
        plots=options.plots,
        caption=options.caption,
        start=options.first,
        end=options.last,
    )

    def page(path: Path) -> Path:
        with working(f"Writing {path.name}"):
            return export_html(runs, path)

    def film(path: Path) -> Path:
        with _Bar(path.name) as bar:
            return export_film(
                run.rollout,
                path,
                style=style,
                robot=run.robot,
                controller=run.controller,
                progress=bar.update,
            )

    def rerun(path: Path) -> Path:
        from hsp_control.visualization.rerun_log import log_to_rerun

        log_to_rerun(run.rollout, run.robot, path=path)
        return path

    wanted = [(options.html, page), (options.rrd, rerun)]
    kept = [(path, write) for path, write in wanted if path]
    return _write([*kept, *((path, film) for path in films)])


def _titled(runs: list["ComparedRun"]) -> list["ComparedRun"]:
    """Return several runs by the titles of their logs, if those can be their names.

    They cannot if two have the same one, as runs of one configuration have, or if one
    is too long for a switch.
    """
    titles = [str(run.rollout.meta.get("title") or "") for run in runs]
    if len(set(titles)) < len(titles):
        return runs
    if not all(0 < len(title) <= _LONGEST for title in titles):
        return runs
    return [run._replace(name=title) for run, title in zip(runs, titles, strict=True)]


def _write(wanted: list[tuple[Path, Callable[[Path], Path]]]) -> int:
    """Write the files; an error that occurs for several of them is printed once."""
    printed: list[str] = []
    for path, write in wanted:
        try:
            size = write(path).stat().st_size
        except ExportError as error:
            if str(error) not in printed:
                print(f"hsp: {error}", file=sys.stderr)
            printed.append(str(error))
        else:
            out.print(f"{size / 1e6:.2f} MB: {path}")
    return 2 if printed else 0


class _Bar:
    """A progress bar of a film on standard error, if that is a terminal."""

    def __init__(self, name: str) -> None:
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            TextColumn("{task.percentage:3.0f} %"),
            TimeRemainingColumn(),
            console=errors,
            transient=True,
            disable=not errors.is_terminal,
        )
        self._task = self._progress.add_task(escape(name), total=1.0)

    def update(self, done: float) -> None:
        self._progress.update(self._task, completed=done)

    def __enter__(self) -> Self:
        self._progress.start()
        return self

    def __exit__(self, *ended: object) -> None:
        self._progress.stop()


def _check_ending(path: Path | None, ending: str) -> None:
    if path is not None and path.suffix.lower() != ending:
        raise ExportError(f"--{ending[1:]} {path}: the name must end with {ending}")
