"""Fixtures of the tests of figures."""

import pytest
from drawn_logs import PAPER, planar, spatial

from hsp_control import Rollout


@pytest.fixture(scope="module")
def logs() -> dict[str, Rollout]:
    """Return runs by their contents: those of the paper, and spatial ones."""
    return {name: planar(number) for name, number in PAPER.items()} | spatial()
