"""Opens the user's browser without waiting for it."""

import logging
import os
import sys
import threading
import webbrowser

_log = logging.getLogger(__name__)


def open_browser(url: str) -> bool:
    """Open a page in the user's browser; return whether there is one."""
    reason = _why_not()
    if reason is not None:
        _log.warning("%s; the view is at %s", reason, url)
        return False
    threading.Thread(target=webbrowser.open, args=(url, 2), daemon=True).start()
    return True


def _why_not() -> str | None:
    """Return why no browser can be opened; None if one can."""
    chosen = "BROWSER" in os.environ
    display = os.environ.keys() & {"DISPLAY", "WAYLAND_DISPLAY"}
    if sys.platform.startswith("linux") and not (display or chosen):
        return "there is no display to open a browser on"
    try:
        browser = webbrowser.get()
    except webbrowser.Error:
        return "there is no browser to open"
    if type(browser) is webbrowser.GenericBrowser and not chosen:
        return f"{browser.name} would take over the terminal"
    return None
