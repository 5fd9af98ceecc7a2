"""A headless browser for tests of pages."""

import os
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from playwright.sync_api import Error

from hsp_control.companions.film.chromium import (
    find_browser,
    headless_browser,
)

PATIENCE = 200.0  # [s], ends a test that hangs
HARMLESS = "GPU stall due to ReadPixels"  # a remark of the software renderer


def started() -> Iterator[Any]:
    """The body of a fixture: a browser; where there is none, the test is skipped."""
    if find_browser() is None:
        if os.environ.get("CI") == "true":
            pytest.fail("CI needs Chromium: apt-get install chromium")
        pytest.skip("there is no Chromium on the path")
    with headless_browser() as browser:
        yield browser


def opened(
    browser: Any, url: str, *, lightly: bool = False, **options: Any
) -> tuple[Any, list[str]]:
    """A page at an address, and the list of its console's errors."""
    page = browser.new_page(**options)
    page.set_default_timeout(1000.0 * PATIENCE)
    wrong: list[str] = []
    page.on("pageerror", lambda error: wrong.append(str(error)))
    page.on(
        "console",
        lambda reported: (
            wrong.append(reported.text)
            if reported.type in {"error", "warning"} and HARMLESS not in reported.text
            else None
        ),
    )
    page.goto(light(url) if lightly else url)
    return page, wrong


def light(url: str) -> str:
    """The address of a page without shadows and mirrors.

    For tests without pictures: without a GPU it needs a fifth of the time.
    """
    return f"{url}{'&' if '#' in url else '#'}light"


def exported(
    browser: Any, file: Path, t: float, size: tuple[int, int]
) -> tuple[Any, list[str]]:
    """An exported page paused at a time [s], since playing takes longer than
    opening."""
    address = f"{file.resolve().as_uri()}#t={t}"
    width, height = size
    viewport = {"width": width, "height": height}
    page, wrong = opened(browser, address, lightly=True, viewport=viewport)
    page.wait_for_selector("body[data-ready]", state="attached")
    return page, wrong


def until(page: Any, expression: str) -> None:
    """Wait until an expression is true; playwright's own way needs eval."""
    deadline = time.monotonic() + PATIENCE
    while not _holds(page, expression):
        assert time.monotonic() < deadline, f"never: {expression}"
        time.sleep(0.02)


def _holds(page: Any, expression: str) -> bool:
    """Return whether an expression is true; false while a page reloads."""
    try:
        return bool(page.evaluate(expression))
    except Error as error:
        if "context was destroyed" not in str(error):
            raise
        return False
