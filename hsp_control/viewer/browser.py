"""Opens the user's browser, without waiting for it."""

import logging
import os
import sys
import threading
import webbrowser

_log = logging.getLogger(__name__)


def open_browser(url: str) -> None:
    """Open a page in the user's browser; a line in the log says if there is none."""
    graphical = os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY", "BROWSER"}
    if sys.platform.startswith("linux") and not graphical:
        # A browser in the terminal, if there is one, would take the terminal over.
        _log.warning("there is no display to open a browser on; the view is at %s", url)
        return

    def attempt() -> None:
        if not webbrowser.open(url, new=2):
            _log.warning("no browser could be opened; the view is at %s", url)

    threading.Thread(target=attempt, daemon=True).start()
