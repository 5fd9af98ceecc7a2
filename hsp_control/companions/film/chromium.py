"""Headless Chromium: finds it, starts it, and opens an exported page."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from hsp_control.common.errors import ExportError

if TYPE_CHECKING:
    from playwright.sync_api import Browser, Page

INSTALL_DRIVER = "pip install 'hsp_control[film]'"
PAGE_TIMEOUT = 120.0
"""Longest time until a page shows its scene [s]."""

_NAMES = (
    "chromium",
    "chromium-browser",
    "google-chrome-stable",
    "google-chrome",
    "chrome",
    "msedge",
)
_FLAGS = (
    "--disable-gpu",  # the same image on every machine
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1",
)


def find_browser() -> str | None:
    """Return the path of Chromium or a browser based on it; None if there is none.

    The environment variable ``HSP_BROWSER`` comes first, then the search path.
    """
    wanted = os.environ.get("HSP_BROWSER")
    if wanted:
        return shutil.which(wanted)
    return next(filter(None, map(shutil.which, _NAMES)), None)


@contextmanager
def headless_browser() -> Iterator["Browser"]:
    """Start a browser without a window."""
    try:
        from playwright.sync_api import Error, sync_playwright
    except ImportError:
        raise ExportError(
            f"a film needs playwright, which is not installed: {INSTALL_DRIVER}"
        ) from None
    root = ["--no-sandbox"] if getattr(os, "geteuid", lambda: 1)() == 0 else []
    with sync_playwright() as driver:
        executable = find_browser() or driver.chromium.executable_path
        if not Path(executable).is_file():
            wanted = os.environ.get("HSP_BROWSER")
            missing = f"HSP_BROWSER={wanted} is not an executable; " if wanted else ""
            raise ExportError(
                f"{missing}a film needs Chromium or Chrome, and none is found on the "
                "path; install one (on Debian: apt-get install chromium; anywhere: "
                "playwright install chromium), or name it in HSP_BROWSER"
            )
        try:
            browser = driver.chromium.launch(
                executable_path=executable, args=[*_FLAGS, *root]
            )
            try:
                yield browser
            finally:
                browser.close()
        except Error as error:
            reason = str(error).strip().splitlines()[0]
            raise ExportError(f"the browser failed: {reason}") from error


def open_page(browser: "Browser", file: Path, size: tuple[int, int]) -> "Page":
    """Open an exported page and wait until it shows its scene."""
    page = browser.new_page(viewport={"width": size[0], "height": size[1]})
    page.goto(file.resolve().as_uri())
    page.wait_for_selector(
        "body[data-ready]", timeout=1e3 * PAGE_TIMEOUT, state="attached"
    )
    return page
