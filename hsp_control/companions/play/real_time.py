"""``hsp play``: a session in real time that a page steers, and the command itself."""

import argparse
import gc
import signal
import sys
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager, suppress
from time import monotonic, sleep
from types import FrameType
from typing import Any

from hsp_control.cli.consoles import out
from hsp_control.cli.loading import own_code
from hsp_control.common.errors import HspControlError, ViewerError
from hsp_control.companions.play.one_page import OnePage
from hsp_control.companions.play.playable import playable_document
from hsp_control.companions.play.session import Session
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.live_picture import FRAME, Picture
from hsp_control.companions.viewer.pages import (
    OpeningPage,
    draw_before,
    draw_empty,
)
from hsp_control.companions.viewer.transport import PageServer
from hsp_control.config import Experiment
from hsp_control.config.loaded_scenario import load_scenario
from hsp_control.config.own_code import add_imports
from hsp_control.live.hardware import described

BEHIND = 0.1
"""A session that is later than this [s] does not catch up: it is slower than real time.
"""
_RATE_WINDOW = 1.0


def play(
    session: Session,
    picture: Picture,
    messages: Callable[[], Iterable[Mapping[str, Any]]],
    save: Callable[[], str],
    *,
    one_page: OnePage | None = None,
    end: Callable[[], bool] = lambda: False,
) -> None:
    """Advance a session in real time until it ends; pages never delay it."""
    running, begin, rate = True, monotonic(), 1.0
    due = drawn = marked = begin
    marked_at = session.t
    while not end():
        steps = 0
        for message in messages():
            match message:
                case {"do": "pause"}:
                    running = False
                case {"do": "go"}:
                    running, due = True, monotonic()
                case {"do": "step"}:
                    running, steps = False, steps + 1
                case {"do": "reset"}:
                    session.reset()
                    picture.begin()
                    due = monotonic()
                case {"do": "save"}:
                    session.handles.say(save())
                    due = monotonic()
                case {"do": "page"} if one_page is not None:
                    try:
                        session.handles.say(one_page.begin())
                    except HspControlError as error:
                        session.handles.say(str(error), warning=True)
                    due = monotonic()
                case _:
                    session.receive(message)
        now = monotonic()
        for _ in range(steps):
            session.advance()
        if running and not session.over:
            if now - due > BEHIND:
                due = now
            if now >= due:
                session.advance()
                due += session.row
        now = monotonic()
        if now - marked >= _RATE_WINDOW:
            rate = max(session.t - marked_at, 0.0) / (now - marked)
            marked, marked_at = now, session.t
        if now - drawn >= FRAME:
            if one_page is not None and (told := one_page.done()):
                session.handles.say(told)
            _draw(picture, running=running and not session.over, rate=rate)
            drawn = now
        wait = due if running and not session.over else drawn + FRAME
        sleep(max(min(wait - monotonic(), FRAME), 0.0))


def _draw(picture: Picture, *, running: bool, rate: float) -> None:
    try:
        picture.draw(running=running, rate=rate)
    except (HspControlError, KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # a user's field or weight may raise anything
        raise ViewerError(f"cannot draw the play: {described(error)}") from error


def play_command(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, and save the log at the end; 2 if a run failed."""
    options.out.mkdir(parents=True, exist_ok=True)  # fails before the play, not after
    with ExitStack() as stack:
        server = PageServer(options.port, host=options.host, steerable=True)
        stack.callback(server.close)
        draw_empty(server, str(options.config))
        page = OpeningPage(
            server.url,
            options,
            lambda url: out.print(f"Play: {url}", soft_wrap=True),
        )
        imports = own_code(options)
        document = playable_document(
            options.config,
            *options.overrides,
            strict=options.strict or bool(options.allow),
            allow=options.allow,
        )
        add_imports(document, imports)
        loaded = load_scenario(document).from_zero()
        view = loaded.scenario.view.all_fields()
        viewer = Viewer(loaded.robot, transport=server, **view)
        draw_before(viewer, loaded)
        experiment = Experiment.of(loaded)
        page.open()
        session = Session(experiment)
        session.rehearse()
        picture = Picture(session, viewer)
        gc.collect()
        gc.freeze()  # objects that exist now are permanent: collections skip them
        stack.enter_context(_stop_at_termination())
        log = options.out / f"{experiment.name}-play.npz"

        def save() -> str:
            try:
                return f"saved: {session.rollout().save(log)}"
            except HspControlError as error:
                return str(error)

        one_page = OnePage(
            lambda: session.rollout().save(log), log.with_suffix(".html")
        )
        stack.callback(one_page.close)
        try:
            with suppress(KeyboardInterrupt):
                out.print("Ctrl-C ends it and saves the log.")
                play(session, picture, server.messages, save, one_page=one_page)
        finally:  # also if the page's server fails, or the picture
            out.print(f"Log: {session.rollout().save(log)}")
        if session.over:  # and it was not reset
            print(f"hsp: {session.over.partition('; reset')[0]}", file=sys.stderr)
    return 2 if session.over else 0


@contextmanager
def _stop_at_termination() -> Iterator[None]:
    """End as at Ctrl-C on SIGTERM: the log is saved."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
