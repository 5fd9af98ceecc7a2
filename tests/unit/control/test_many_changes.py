"""Changes at a higher rate than past ones are forgotten."""

import sys
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.trajectories.crossfade import Crossfade

ROBOT = hsp.Robot.load("panda")
HOME, REST = ROBOT.home(), np.zeros(7)
HAND = ROBOT.state(0.0, HOME, REST).position("panda_tcp")
Make = Callable[[Any, int], None]

MOVES: dict[str, Make] = {
    "reference": lambda at, k: at.reference("hand", hsp.Hold(HAND + 0.001 * (k % 2))),
    "obstacle": lambda at, k: at.obstacle("ball", hsp.Hold([0.5, 0.6, 0.9 + k % 2])),
    "tool": lambda at, k: at.tool("panda_tcp", position=[0.0, 0.0, 0.001 * (k % 2)]),
}


def controller() -> hsp.Controller:
    ball = hsp.Obstacle("ball", hsp.shapes.Sphere(0.05), [0.5, 0.6, 0.9])
    hand = hsp.FramePosition("panda_tcp", name="hand")
    made = hsp.Controller(ROBOT, [hand], hsp.JointCentering(), scene=[ball])
    made.compute(0.0, HOME, REST)
    return made


@pytest.mark.parametrize("kind", MOVES)
def test_those_that_are_over_do_not_gather(kind: str) -> None:
    """A thousand per second, each over before the next: at most two are stored."""
    made = controller()
    for k in range(100):
        MOVES[kind](made.at(0.001 * k).ramp(0.0005), k)
        made.compute(0.001 * (k + 1), HOME, REST)
        assert len(made.changes) <= 2


@pytest.mark.parametrize("kind", MOVES)
def test_too_many_that_overlap_are_refused(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The change beyond the maximum is refused without effect; the run continues."""
    module = sys.modules[Crossfade.__module__]
    # not 64: every change costs time
    monkeypatch.setattr(module, "MOST_OVERLAPPING", 8)
    made = controller()
    for k in range(8):
        MOVES[kind](made.at(0.0).ramp(1.0 + k), k)
    words = "9 changes of one reference overlap; at most 8.* use a stream, such as"
    with pytest.raises(hsp.errors.TrajectoryError, match=words):
        MOVES[kind](made.at(0.0).ramp(100.0), 0)
    assert len(made.changes) == 8
    made.compute(0.001, HOME, REST)
