"""A live loop that hears a stream has all of its machine code before it begins."""

import subprocess
import sys

import pytest
from places import ROOT

from hsp_control.compiled.kernels import PLAIN

pytestmark = [
    pytest.mark.process,
    pytest.mark.skipif(PLAIN, reason="nothing is compiled"),
]

LOOP = """
import gc
import sys

import numpy as np
import pinocchio as pin
from numba.core.dispatcher import Dispatcher

import hsp_control as hsp
from hsp_control.compiled import adapters
from hsp_control.live import run_loop

sys.path.append(sys.argv[1])
from live_rigs import Rig, panda, start

rest = panda().state(0.0, start(), np.zeros(7)).frame("panda_tcp")
stream = hsp.StreamPose(delay=0.02)
task = hsp.FramePose("panda_tcp", stream)
kernels = [each for each in gc.get_objects() if isinstance(each, Dispatcher)]
assert len(kernels) > 100
counts = []


def here(height):
    point = rest.position + np.array([0.0, 0.0, height])
    turned = rest.rotation @ pin.exp3(np.array([0.0, 0.0, height]))
    return pin.SE3ToXYZQUAT(pin.SE3(turned, point))


def hear(t):
    counts.append(len(adapters._codes) + sum(len(each.overloads) for each in kernels))
    up = np.array([0.0, 0.0, 0.02, 0.0, 0.0, 0.1])
    {
        20: lambda: stream.send(here(0.001)),
        60: lambda: stream.send(here(0.002), velocity=up),
        100: lambda: stream.send_chunk([here(0.003), here(0.004)], [0.05, 0.1]),
        180: lambda: stream.send(velocity=-up),
    }.get(len(counts), int)()


report = run_loop(hsp.Controller(panda(), [task]), Rig(), duration=0.3, on_period=hear)
assert report.ended == "completed", report.reason
assert len(counts) > 250
print(*sorted(set(counts[10:])))  # the simulated robot makes its own at its first step
"""
"""Prints how many signatures have machine code while the loop runs, each number once.

In a process of its own: others may have made what this loop needs.
"""


def test_a_message_compiles_and_loads_nothing() -> None:
    loop = [sys.executable, "-c", LOOP, str(ROOT / "tests" / "support")]
    ran = subprocess.run(loop, capture_output=True, text=True, check=False)
    assert ran.returncode == 0, ran.stderr
    assert len(ran.stdout.split()) == 1, f"first, then: {ran.stdout}"
