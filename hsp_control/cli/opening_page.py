"""A page that opens at once: it says that kernels are compiled, and how many."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

from hsp_control.cli.compiling import compiling_told
from hsp_control.common.exceptions import HspControlError, ViewerError
from hsp_control.config.experiment import Setup
from hsp_control.visualization.viewer import Viewer, browser
from hsp_control.visualization.viewer.commands import set_status
from hsp_control.visualization.viewer.transport import Transport


class OpeningPage:
    """Opens a page once: at the first kernel that has to be compiled, or when told to.

    A mistake in a configuration is then said before, unless the cache is empty.

    Attributes:
        opened: Whether it was opened in a browser.
    """

    def __init__(
        self,
        transport: Transport,
        options: argparse.Namespace,
        announce: Callable[[str], object],
    ) -> None:
        """Keep what it takes.

        Args:
            transport: The way to the page.
            options: The command's, of which ``browser`` says whether to open one.
            announce: Prints the page's address.
        """
        assert transport.url is not None
        self.opened = False
        self._transport, self._url = transport, transport.url
        self._browser, self._announce = options.browser, announce
        self._done = self._told = False

    def open(self) -> None:
        """Print the address, and open the page in a browser."""
        if self._done:
            return
        self._done = True
        self._announce(self._url)
        if self._browser:
            self.opened = browser.open_browser(self._url)

    def ready(self) -> None:
        """Open the page, if it is not open, and hide what it says of kernels."""
        self.open()
        if self._told:
            self._transport.send([set_status("")])

    @contextmanager
    def compiling(self) -> Iterator[None]:
        """Say on the page how many kernels are compiled; the first one opens it."""

        def tell(text: str) -> None:
            self._told = True
            with suppress(ViewerError):  # who uses the page is told in any case
                self._transport.send([set_status(text)])
            self.open()

        with compiling_told(tell):
            yield


def draw_before(viewer: Viewer, setup: Setup) -> None:
    """Show the robot at its start, and the scene, before a controller is composed.

    Raises:
        ViewerError: If the server has ended.
    """
    viewer.draw_scene(setup.scene, title=setup.scenario.title or None)
    try:
        start = setup.start()
    except HspControlError:  # `build` says where the mistake is
        start = setup.robot.home()
    viewer.show(start)
