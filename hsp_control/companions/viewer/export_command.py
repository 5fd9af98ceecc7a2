"""``hsp export``: write logs as a page for offline use, or one as films."""

import argparse
import sys
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Self

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from hsp_control.cli.consoles import errors, out, working
from hsp_control.common.exceptions import ExportError
from hsp_control.companions.viewer.export_format import export_formats

if TYPE_CHECKING:
    from hsp_control.companions.viewer.comparison import ComparedRun

_LONGEST = 24
"""Longest title that is a name in the switch between runs."""


def export(options: argparse.Namespace) -> int:
    """Write every requested file; a file that fails does not stop the others."""
    from hsp_control.companions.viewer.export_page import export_html
    from hsp_control.companions.viewer.replay import access_for, load_runs

    formats = {end: each for each in export_formats() for end in each.files}
    asked = {end: path for end in formats if (path := getattr(options, end))}
    if not (options.html or asked):
        known = ", ".join(f"--{name}" for name in ("html", *formats))
        raise ExportError(f"nothing to write: give a file with one of {known}")
    for ending, path in asked.items():
        if path.suffix.lower() != f".{ending}":
            raise ExportError(f"--{ending} {path}: the name must end with .{ending}")
        if len(options.logs) > 1:
            raise ExportError(
                f"{formats[ending].what} shows one run, {len(options.logs)} logs are "
                "given: give one log, or --html for a page with a switch between them"
            )
    strict = options.strict or bool(options.allow)
    access = access_for(options.logs, strict, options.allow)
    runs = _titled(load_runs(options.logs, access))

    def page(path: Path) -> Path:
        with working(f"Writing {path.name}"):
            return export_html(runs, path)

    def added(ending: str, path: Path) -> Path:
        with _Bar(path.name) as bar:
            return formats[ending].write(runs[0], path, options, bar.update)

    wanted = [(path, partial(added, ending)) for ending, path in asked.items()]
    return _write([*([(options.html, page)] if options.html else []), *wanted])


def _titled(runs: list["ComparedRun"]) -> list["ComparedRun"]:
    """Return several runs by the titles of their logs, if those can be their names."""
    # They cannot if two have the same one, as runs of one configuration have, or if one
    # is too long for a switch.
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
