"""``hsp play``: a simulated robot that a page steers, in real time."""

import argparse
import gc
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from types import FrameType

from hsp_control.cli.consoles import out
from hsp_control.common import kernels
from hsp_control.common.exceptions import HspControlError
from hsp_control.play import Picture, Session
from hsp_control.play import play as play_in_real_time
from hsp_control.play.playable import playable
from hsp_control.visualization.viewer import Viewer, browser
from hsp_control.visualization.viewer.commands import set_caption, set_status
from hsp_control.visualization.viewer.server import Server


def play(options: argparse.Namespace) -> int:
    """Serve the page until Ctrl-C, and save the log at the end."""
    options.out.mkdir(parents=True, exist_ok=True)  # fails before the play, not after
    with ExitStack() as stack:
        page = _Page(Server(options.port, host=options.host, steerable=True), options)
        stack.callback(page.server.close)
        with kernels.watched(page.compiling):
            experiment = playable(
                options.config,
                *options.overrides,
                strict=options.strict or bool(options.allow),
                allow=options.allow,
            )
            view = experiment.scenario.view.all_fields()
            viewer = Viewer(experiment.robot, transport=page.server, **view)
            page.open()
            session = Session(experiment)
            session.rehearse()
            picture = Picture(session, viewer)
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
            play_in_real_time(session, picture, page.server.messages, save)
        out.print(f"Log: {session.rollout().save(log)}")
    return 0


class _Page:
    """Opens the page once: when kernels have to be compiled, or all is ready."""

    def __init__(self, server: Server, options: argparse.Namespace) -> None:
        self.server = server
        self._options = options
        self._opened, self._done = False, 0

    def open(self) -> None:
        """Print the address, and open the page in a browser."""
        if self._opened:
            return
        self._opened = True
        assert self.server.url is not None
        out.print(f"Play: {self.server.url}", soft_wrap=True)
        if self._options.browser:
            browser.open_browser(self.server.url)

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Say on the page that a kernel is being compiled."""
        text = f"Compiling kernels (once, 10 to 20 s) … {self._done} done"
        caption = [] if self._opened else [set_caption(str(self._options.config), [])]
        self.server.send([*caption, set_status(text)])
        self.open()
        yield
        self._done += 1


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
