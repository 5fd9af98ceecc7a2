"""A page that opens at once: it says that kernels are compiled, and how many."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from hsp_control.cli.consoles import compiling_told
from hsp_control.common.exceptions import HspControlError, ViewerError
from hsp_control.config.loaded_scenario import LoadedScenario
from hsp_control.config.view_settings import ViewSettings
from hsp_control.visualization.viewer import Viewer, browser
from hsp_control.visualization.viewer.commands import set_caption, set_status
from hsp_control.visualization.viewer.stage import draw_background
from hsp_control.visualization.viewer.transport import Transport


class OpeningPage:
    """Opens a page once: at the first kernel that has to be compiled, or when told to.

    A mistake in a configuration is then said before, unless the cache is empty.
    """

    def __init__(
        self,
        url: str | None,
        options: argparse.Namespace,
        announce: Callable[[str], object],
        say: Callable[[str], object],
    ) -> None:
        """Keep what it takes."""
        assert url is not None
        self.opened = False  # whether it was opened in a browser
        self._url, self._browser = url, options.browser
        self._announce, self._say = announce, say
        self._done = self._told = self._ready = False

    def open(self) -> None:
        """Print the address, and open the page in a browser."""
        if self._done:
            return
        self._done = True
        self._announce(self._url)
        if self._browser:
            self.opened = browser.open_browser(self._url)

    def ready(self) -> None:
        """Open the page, if it is not open; from now on it says nothing of kernels."""
        self.open()
        self._ready = True
        if self._told:
            self._say("")

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Say on the page how many kernels are compiled; the first one opens it.

        Where what is done then fails, an open page says why: it stays, and would count
        kernels for ever.
        """

        def tell(text: str) -> None:
            if self._ready:
                return
            self._told = True
            with suppress(ViewerError):  # who uses the page is told in any case
                self._say(text)
            self.open()

        try:
            with compiling_told(tell):
                yield
        except HspControlError as error:
            if self._done and not self._ready:
                with suppress(ViewerError):
                    self._say(str(error))
            raise


def status_line(transport: Transport) -> Callable[[str], object]:
    """Return what sets the status line of the pages of a transport."""
    return lambda text: transport.send([set_status(text)])


def draw_empty(transport: Transport, title: str) -> None:
    """Show a title on an empty stage, before the robot is loaded."""
    transport.send([*draw_background(ViewSettings()), set_caption(title, [])])


def draw_before(viewer: Viewer, loaded: LoadedScenario) -> None:
    """Show the robot at its start, and the scene, before a controller is composed."""
    viewer.draw_scene(loaded.scene, title=loaded.scenario.title or None)
    try:
        start = loaded.start()
    except HspControlError:  # `Experiment.of` says where the mistake is
        start = loaded.robot.home()
    viewer.show(start)
