"""``hsp play``: a simulated robot that a page steers, in real time."""

import argparse
import gc
import signal
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType

from hsp_control.cli.consoles import out
from hsp_control.cli.loading import run_imports
from hsp_control.common.exceptions import HspControlError
from hsp_control.companions.play import Picture, Session
from hsp_control.companions.play import play as play_in_real_time
from hsp_control.companions.play.playable import playable_document
from hsp_control.companions.viewer import Viewer
from hsp_control.companions.viewer.pages import (
    OpeningPage,
    draw_before,
    draw_empty,
    status_line,
)
from hsp_control.companions.viewer.transport import PageServer
from hsp_control.config import Experiment
from hsp_control.config.loaded_scenario import load_scenario


def play(options: argparse.Namespace) -> int:
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
            status_line(server),
        )
        with page.compiling():
            run_imports(options)
            document = playable_document(
                options.config,
                *options.overrides,
                strict=options.strict or bool(options.allow),
                allow=options.allow,
            )
            loaded = load_scenario(document)
            view = loaded.scenario.view.all_fields()
            viewer = Viewer(loaded.robot, transport=server, **view)
            draw_before(viewer, loaded)
            experiment = Experiment.of(loaded)
            page.open()
            session = Session(experiment)
            session.rehearse()
            picture = Picture(session, viewer)
        page.ready()
        gc.collect()
        gc.freeze()  # what is there now stays: no collection looks at it in a row
        stack.enter_context(_stop_at_termination())
        log = options.out / f"{experiment.name}-play.npz"

        def save() -> str:
            try:
                return f"saved: {session.rollout().save(log)}"
            except HspControlError as error:
                return str(error)

        with suppress(KeyboardInterrupt):
            out.print("Ctrl-C ends it and saves the log.")
            play_in_real_time(session, picture, server.messages, save)
        out.print(f"Log: {session.rollout().save(log)}")
        if session.over:  # and was not reset
            print(f"hsp: {session.over.partition('; reset')[0]}", file=sys.stderr)
    return 2 if session.over else 0


@contextmanager
def _stop_at_termination() -> Iterator[None]:
    """End as at Ctrl-C when the process is asked to terminate: the log is saved."""

    def stop(_number: int, _frame: FrameType | None) -> None:
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)
