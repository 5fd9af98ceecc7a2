"""Fixtures of the tests of runs."""

import pytest
from closed_loops import EXACT, planar_controller, planar_start

from hsp_control import Rollout, simulate


@pytest.fixture(scope="module")
def planar_run() -> Rollout:
    """Return 0.5 s of the planar arm, logged every 10 ms."""
    return simulate(planar_controller(), planar_start(), duration=0.5, integrator=EXACT)
