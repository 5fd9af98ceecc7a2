"""Fixtures of the tests of the view: a short run, and an arm."""

import pytest
from clips import Recorder

from hsp_control import Robot, Rollout, load_experiment


@pytest.fixture(scope="module")
def run() -> Rollout:
    return load_experiment("paper/4_moving_obstacle", "simulation.duration=1.5").run()


@pytest.fixture(scope="module")
def arm() -> Robot:
    return Robot.load("planar3r")


@pytest.fixture
def recorder() -> Recorder:
    """Receive the messages of a view to its page."""
    return Recorder()
