"""Fixtures of tests of frozen controllers: the example that replays one, a library."""

from pathlib import Path

import pytest
from frozen_library import Opened
from frozen_runs import EXAMPLE, compiled


@pytest.fixture(scope="session")
def replay(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Compile the program that reads states and writes efforts."""
    return compiled(EXAMPLE / "replay.c", tmp_path_factory.mktemp("replay"))


@pytest.fixture
def opened(frozen: Path) -> Opened:
    """Open the frozen controller of the file, for one test."""
    return Opened(frozen)
