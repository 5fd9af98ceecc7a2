"""Feedback of an error up to the largest one: s(e) = e until then, and no more."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from task_cases import GAINS, TIME, Case, Direction, every_task, place, placed

import hsp_control as hsp

Array = NDArray[np.float64]


@pytest.mark.slow
@every_task
def test_an_error_up_to_the_largest_counts_in_full(case: Case) -> None:
    """To the last bit; and a little beyond it the task's acceleration has not jumped.

    A direction's coordinates are bounded by themselves.
    """
    motion = place(case, 3)
    robot = motion.robot
    made: Any = case.family.make(robot, motion, 0.5, GAINS, 3)
    state = robot.state(TIME, motion.q, motion.v)

    def wanted(largest: Any) -> Array:
        task = placed(replace(made, largest_error=largest), robot)
        return task.evaluate(state).acceleration.copy()

    free = wanted("none")
    ends = np.cumsum([each.size for each in placed(made, robot).error_parts])[:-1]
    e = placed(made, robot).evaluate(state).error
    size = [float(np.linalg.norm(part)) for part in np.split(e, ends)]
    np.testing.assert_array_equal(wanted([1.000001 * each for each in size]), free)
    beyond = wanted([each / 1.000001 for each in size])
    np.testing.assert_allclose(beyond, free, rtol=0, atol=1e-4)
    if not isinstance(case.family, Direction):
        assert (beyond != free).any()


def test_the_largest_errors_of_a_robot() -> None:
    """0.3 of its size for positions, 1 rad for orientations, none for joints."""
    robot = panda()
    pose = placed(hsp.FramePose("panda_tcp"), robot)
    assert pose.largest_error == (0.3 * robot.size, 1.0)
    assert placed(hsp.JointPosture("home"), robot).largest_error == (None,)
    one = placed(hsp.FramePose("panda_tcp", largest_error=0.2), robot)
    assert one.largest_error == (0.2, 0.2)
    part = placed(hsp.FramePose("panda_tcp", largest_error=[None, 0.2]), robot)
    np.testing.assert_array_equal(part.feedback().largest, [[3.0, 6.0, 0.2]])
    none = placed(hsp.FramePose("panda_tcp", largest_error="none"), robot)
    assert len(none.feedback().largest) == 0
    for each in (pose, one, part, none):  # what is placed can be placed again
        assert placed(each, robot).largest_error == each.largest_error


@cache
def panda() -> hsp.Robot:
    return hsp.Robot.load("panda")


@pytest.mark.parametrize("largest", [0.02, 0.1])
def test_its_energy_falls(largest: float) -> None:
    """E = ½|e'|² + ∫ Kp s(e)·de falls by ∫ Kv|e'|² dt: the equation is a gradient's."""
    robot, k = panda(), 100.0
    q0 = robot.home()
    here = robot.state(0.0, q0, np.zeros(7)).position("panda_tcp").copy()
    target = hsp.Hold(here + np.array([-0.1, 0.25, -0.15]))
    hand = hsp.FramePosition(
        "panda_tcp",
        target,
        gains=hsp.Gains(natural_frequency=10.0),
        largest_error=largest,
        name="hand",
    )
    controller = hsp.Controller(robot, [hand], limits=None)
    run = hsp.simulate(
        controller,
        q0,
        duration=1.5,
        log_period=2e-3,
        integrator=hsp.integrators.Rk4(2e-3),
    )
    assert not run["damped"].any()
    task, energy, speed = controller.tasks[0], [], []
    for t, q, v in zip(run.t, run.q, run["v"], strict=True):
        sample = task.evaluate(robot.state(t, q, v))
        r, rate = np.linalg.norm(sample.error), np.linalg.norm(sample.error_rate)
        inside = min(r, largest)
        potential = k * (0.5 * inside**2 + largest * (r - inside))
        energy.append(0.5 * rate**2 + potential)
        speed.append(rate)
    steps = np.diff(energy)
    assert (steps <= 1e-12).all()
    squares = np.square(speed)
    lost = 20.0 * 2e-3 * 0.5 * (squares[1:] + squares[:-1])
    np.testing.assert_allclose(-steps.sum(), lost.sum(), rtol=1e-4)
    assert max(speed) <= 1.0001 * k * largest / 20.0  # where both balance
