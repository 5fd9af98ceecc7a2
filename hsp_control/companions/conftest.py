"""Fixtures of the tests of companions' pages."""

from collections.abc import Iterator
from typing import Any

import pytest


@pytest.fixture(scope="module")
def browser() -> Iterator[Any]:
    """Start a browser without a window; skip where there is none."""
    pytest.importorskip("playwright.sync_api")
    from browsers import started

    yield from started()
