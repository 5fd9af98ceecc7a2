"""The pages of commands: they open when everything is ready, and stay open.

And ``hsp export``, which writes logs as a page for offline use, or one as films.
"""

import argparse
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import ExitStack, closing, contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Self

from rich.markup import escape
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

from hsp_control.cli.consoles import errors, out, working
from hsp_control.cli.interrupts import end_in_order
from hsp_control.cli.loading import run_imports
from hsp_control.common.errors import ExportError, HspControlError, ViewerError
from hsp_control.common.keywords import suggesting
from hsp_control.companions.viewer import (
    ComparedRun,
    LiveView,
    Viewer,
    export_html,
    transport,
    view_logs,
)
from hsp_control.companions.viewer.commands import set_caption, set_status
from hsp_control.companions.viewer.replay import access_for, load_runs
from hsp_control.companions.viewer.stage import draw_background
from hsp_control.companions.viewer.transport import PageServer, SceneRecorder
from hsp_control.config import Experiment
from hsp_control.config.loaded_scenario import LoadedScenario
from hsp_control.config.scenario import ViewSettings
from hsp_control.simulation import Rollout
from hsp_control.simulation.log_writer import LogWriter


class OpeningPage:
    """Opens a page once, when everything is ready: errors are raised before."""

    def __init__(
        self,
        url: str | None,
        options: argparse.Namespace,
        announce: Callable[[str], object],
    ) -> None:
        assert url is not None
        self.opened = False  # whether it was opened in a browser
        self._url, self._browser = url, options.browser
        self._announce, self._done = announce, False

    def open(self) -> None:
        """Print the address, and open the page in a browser."""
        if self._done:
            return
        self._done = True
        self._announce(self._url)
        if self._browser:
            self.opened = transport.open_browser(self._url)


def status_line(transport: SceneRecorder) -> Callable[[str], object]:
    """Return a function that sets the status line of a transport's pages."""
    return lambda text: transport.send([set_status(text)])


def draw_empty(transport: SceneRecorder, title: str) -> None:
    """Show a title on an empty stage, before the robot is loaded."""
    transport.send([*draw_background(ViewSettings()), set_caption(title, [])])


def draw_before(viewer: Viewer, loaded: LoadedScenario) -> None:
    """Show the robot at its start, and the scene, before a controller is composed."""
    viewer.draw_scene(loaded.scene, title=loaded.scenario.title or None)
    try:
        start = loaded.start()
    except HspControlError:  # `Experiment.of` names the place
        start = loaded.robot.home()
    viewer.show(start)


PAGE_TIMEOUT = 15.0
"""Time in which a started browser must show the page [s]."""


class Screen:
    """Shows a run: before it, while it runs, and after."""

    def __init__(
        self, viewer: Viewer | None = None, page: OpeningPage | None = None
    ) -> None:
        self._viewer, self._page = viewer, page  # None if it failed, which was reported
        self._live: LiveView | None = None

    @classmethod
    @contextmanager
    def open(
        cls, options: argparse.Namespace, loaded: LoadedScenario
    ) -> Iterator[Self]:
        """Yield a screen that shows the robot and the scene."""
        # The page opens when `begin` is called.
        end_in_order()
        said = errors if options.json else out
        view = loaded.scenario.view.all_fields()
        with ExitStack() as stack:
            try:
                viewer = Viewer(loaded.robot, port=options.port, **view)
                stack.enter_context(viewer)
                draw_before(viewer, loaded)
            except ViewerError as error:
                _say_without(error)
                yield cls()
                return
            page = OpeningPage(
                viewer.url,
                options,
                lambda url: said.print(f"View: {url}"),
            )
            yield cls(viewer, page)

    def begin(self, experiment: Experiment) -> None:
        """Show the run's start, and open the page."""
        if self._viewer is None or self._page is None:
            return
        try:
            self._live = LiveView(self._viewer, experiment)
        except ViewerError as error:
            _say_without(error)
        else:
            self._page.open()

    def on_row(self, recorder: LogWriter) -> None:
        """Show the rows computed so far."""
        if self._live is not None:
            self._live.on_row(recorder)

    def finish(self, rollout: Rollout) -> int:
        """Show the whole run until the user closes the view; 2 if there is none."""
        if self._viewer is None or self._page is None or self._live is None:
            return 2
        self._live.finish(rollout)
        attend(self._viewer, opened=self._page.opened)
        return 0


def _say_without(error: ViewerError) -> None:
    print(f"hsp: {error}; the run continues without a view", file=sys.stderr)


def show_logs(options: argparse.Namespace) -> None:
    """Play logs until the user closes the view."""
    run_imports(options)
    with ExitStack() as stack:
        server = stack.enter_context(closing(PageServer(options.port)))
        draw_empty(server, ", ".join(log.stem for log in options.logs))
        page = OpeningPage(
            server.url,
            options,
            lambda url: out.print(f"View: {url}"),
        )
        viewer = view_logs(
            options.logs,
            beside=options.beside,
            speed=options.speed,
            loop=options.loop,
            transport=server,
            strict=options.strict or bool(options.allow),
            allow=options.allow,
        )
        page.open()
        attend(viewer, opened=page.opened)


def attend(viewer: Viewer, *, opened: bool) -> None:
    """Keep a view open until the user closes it."""
    # In a terminal: until Enter or Ctrl-C. Without a terminal: until the page is
    # closed, if a browser was opened; otherwise return at once.
    with suppress(KeyboardInterrupt):
        if sys.stdin is not None and sys.stdin.isatty():
            with suppress(EOFError):
                input("Press Enter to close the view. ")
        elif opened and viewer.wait_for_browser(PAGE_TIMEOUT):
            viewer.wait_until_closed()


Writer = Callable[
    [ComparedRun, Path, argparse.Namespace, Callable[[float], None]], Path
]
_LONGEST = 24
"""Longest title that is a name in the switch between runs."""


@suggesting
def export(
    options: argparse.Namespace, formats: Mapping[str, tuple[str, Writer]]
) -> int:
    """Write every requested file; a file that fails does not stop the others.

    ``formats``: besides the page, the name of each further format and its writer, by
    endings.
    """
    asked = {end: path for end in formats if (path := getattr(options, end))}
    if not (options.html or asked):
        known = ", ".join(f"--{name}" for name in ("html", *formats))
        raise ExportError(f"nothing to write: give a file with one of {known}")
    for ending, path in asked.items():
        if path.suffix.lower() != f".{ending}":
            raise ExportError(f"--{ending} {path}: the name must end with .{ending}")
        if len(options.logs) > 1:
            raise ExportError(
                f"{formats[ending][0]} shows one run, {len(options.logs)} logs are "
                "given: give one log, or --html for a page with a switch between them"
            )
    run_imports(options)
    strict = options.strict or bool(options.allow)
    access = access_for(options.logs, strict, options.allow)
    runs = _titled(load_runs(options.logs, access))

    def page(path: Path) -> Path:
        with working(f"Writing {path.name}"):
            return export_html(runs, path)

    def added(ending: str, path: Path) -> Path:
        with _Bar(path.name) as bar:
            return formats[ending][1](runs[0], path, options, bar.update)

    wanted = [(path, partial(added, ending)) for ending, path in asked.items()]
    return _write([*([(options.html, page)] if options.html else []), *wanted])


def _titled(runs: list[ComparedRun]) -> list[ComparedRun]:
    """Return several runs by the titles of their logs, if those can be their names."""
    # They cannot if two are equal, as of runs of one configuration, or if one is too
    # long for a switch.
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
