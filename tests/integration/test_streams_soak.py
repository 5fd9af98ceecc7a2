"""Thousands of targets leave a controller's memory, pickle and representation
unchanged.

In a script half a million did so.
"""

import gc
import pickle
import tracemalloc
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from places import further

import hsp_control as hsp
from hsp_control.trajectories.streams import inbox

PANDA = hsp.Robot.load("panda")
Q, V = PANDA.home(), np.zeros(7)
HERE = PANDA.state(0.0, Q, V).frame("panda_tcp")
QUATERNION = pin.SE3ToXYZQUAT(pin.SE3(HERE.rotation, HERE.position))[3:]
PERIOD = 5e-3
EACH = 200  # targets in a part of the run, of 1 s


@pytest.mark.parametrize(
    "policy", ["interpolate", "twists", *further("latest", "extrapolate")]
)
def test_targets_are_forgotten(policy: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    """Waiting and recorded messages are bounded, and full after the first part."""
    monkeypatch.setattr(inbox, "CAPACITY", 64)
    monkeypatch.setattr(inbox, "BRIEF", 2_000)
    origin, rng = HERE.position.copy(), np.random.default_rng(2)
    twists = policy == "twists"
    stream = hsp.StreamPose(policy="latest" if twists else policy, delay=0.02)
    controller = hsp.Controller(PANDA, [hsp.FramePose("panda_tcp", stream)])
    hand = controller.stream("panda_tcp")
    memory: list[int] = []
    sizes, words, lengths = [], [], []
    tracemalloc.start()
    try:
        for k in range(4 * EACH):
            if twists:
                hand.send(velocity=0.02 * rng.normal(size=6), axes="tool")
            else:
                near = origin + 1e-3 * rng.normal(size=3)
                hand.send(np.concatenate([near, QUATERNION]), t=PERIOD * k)
            tau = controller.compute(PERIOD * k, Q, V).tau
            controller.applied(tau, PERIOD)
            if (k + 1) % EACH == 0:
                gc.collect()
                sizes.append(tracemalloc.get_traced_memory()[0])
                lengths.append(len(pickle.dumps(controller)))
                words.append(repr(controller))
                followed: Any = controller.tasks[0].followed
                planner = followed.run._planner
                memory += [len(planner._past), planner._room.waypoints]
    finally:
        tracemalloc.stop()
    assert len(set(words)) == 1
    # Pieces and waypoints of the last second are kept: a number that varies a little.
    assert max(lengths[1:]) < 1.1 * min(lengths[1:])
    assert max(sizes[1:]) < sizes[1] + 60_000  # of a target 500 bytes would be 200 kB
    assert followed.run.unrecorded > 2 * EACH
    assert max(memory) < 600
