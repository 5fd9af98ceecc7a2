"""What memory a step takes at once, and that it keeps none."""

import os
import tracemalloc

import numpy as np
import pytest

from hsp_control import load_experiment

MOST = 560
"""Bytes at once: the effort as Pinocchio returns it, the output's tuple, floats; 496
were seen. A matrix more would not fit; a vector that is freed at once is not seen."""


@pytest.mark.skipif(
    os.environ.get("NUMBA_DISABLE_JIT") == "1", reason="plain Python makes floats"
)
@pytest.mark.parametrize(
    "name", ["panda_obstacle", "panda_manipulability", "limits/panda_half_strength"]
)
def test_a_step_takes_little_memory_and_keeps_none(name: str) -> None:
    experiment = load_experiment(name)
    controller, robot = experiment.controller, experiment.robot
    state, rng = controller.state, np.random.default_rng(7)
    v = 0.01 * rng.standard_normal((40, robot.nv))
    paths = [(0.01 * k, robot.integrate(experiment.q0, v[k]), v[k]) for k in range(40)]
    out = controller.compute(*paths[0])
    for path in paths:  # compile, bind, and see what limits let through
        assert controller.compute(state.update(*path), out=out).status == 0
    tracemalloc.start()
    try:
        for path in paths:
            before = tracemalloc.get_traced_memory()[0]
            tracemalloc.reset_peak()
            controller.compute(state.update(*path), out=out)
            assert tracemalloc.get_traced_memory()[1] - before <= MOST
        before = tracemalloc.get_traced_memory()[0]
        for path in 25 * paths:
            controller.compute(state.update(*path), out=out)
        assert tracemalloc.get_traced_memory()[0] - before <= MOST
    finally:
        tracemalloc.stop()
