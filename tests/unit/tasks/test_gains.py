"""Gains, and the feedback of an error up to the largest one."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from loaded_robots import panda
from places import further
from task_cases import GAINS, TIME, Case, Direction, every_task, place, placed
from wording import wording

import hsp_control as hsp
from hsp_control import Controller, Gains, JointPosture, Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import GainError


@pytest.mark.slow
@every_task
def test_an_error_up_to_the_largest_is_fed_back_linearly(case: Case) -> None:
    """Bit for bit; and just beyond the bound the task's acceleration is continuous.

    A direction's coordinates are bounded by definition.
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
    """0.35 of the robot's size for positions, 1 rad for orientations, none for
    joints."""
    robot = panda()
    pose = placed(hsp.FramePose("panda_tcp"), robot)
    assert pose.largest_error == (0.35 * robot.size, 1.25)
    assert placed(hsp.JointPosture("home"), robot).largest_error == (None,)
    one = placed(hsp.FramePose("panda_tcp", largest_error=0.2), robot)
    assert one.largest_error == (0.2, 0.2)
    part = placed(hsp.FramePose("panda_tcp", largest_error=[None, 0.2]), robot)
    np.testing.assert_array_equal(part.feedback().largest, [[3.0, 6.0, 0.2]])
    none = placed(hsp.FramePose("panda_tcp", largest_error="none"), robot)
    assert len(none.feedback().largest) == 0
    for each in (pose, one, part, none):  # placed parts can be placed again
        assert placed(each, robot).largest_error == each.largest_error


@pytest.mark.parametrize("largest", [0.02, *further(0.1)])
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


def test_gains_in_three_forms() -> None:
    for kp, kv in (
        (4.0, 5.0),
        ([4.0, 4.0], [5.0, 5.0]),
        (4 * np.eye(2), 5 * np.eye(2)),
    ):
        Kp, Kv = Gains(kp, kv).matrices(2)
        np.testing.assert_array_equal(Kp, 4.0 * np.eye(2))
        np.testing.assert_array_equal(Kv, 5.0 * np.eye(2))
    Kp, Kv = Gains([1.0, 2.0], [[3.0, 0.5], [0.1, 4.0]]).matrices(2)
    np.testing.assert_array_equal(Kp, np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(Kv, [[3.0, 0.5], [0.1, 4.0]])


def test_a_change_leads_both_gains_to_the_new_ones() -> None:
    """Unchanged before the ramp, the mean half-way, exactly the new ones after it."""
    robot = Robot.load("planar3r")
    old, new = Gains([4.0, 5.0, 6.0], 7.0), Gains(40.0, [10.0, 20.0, 30.0])
    controller = Controller(robot, [JointPosture("home", gains=old)])
    first, last = old.matrices(3), new.matrices(3)
    half = [0.5 * (a + b) for a, b in zip(first, last, strict=True)]
    controller.at(1.0).ramp(0.5).gains("posture", new)
    for t, expected in ((0.0, first), (1.0, first), (1.25, half), (1.5, last)):
        controller.compute(t, robot.home(), np.zeros(3))
        Kp, Kv, offset, *_ = controller.feedback("posture")
        np.testing.assert_allclose(Kp, expected[0], rtol=1e-14)
        np.testing.assert_allclose(Kv, expected[1], rtol=1e-14)
        assert not offset.any()


GAIN_ERRORS: dict[str, tuple[Callable[[], Any], str]] = {
    "diagonal": (lambda: Gains([[1.0, 0.0], [0.0, -2.0]], 1.0),
     "Gains: kp[1, 1] is -2 ... greater than 0"),
    "not square": (lambda: Gains(np.ones((2, 3)), 1.0),
     "Gains: kp ... (2, 3) ... square"),
    "empty": (lambda: Gains([], 1.0), "Gains: kp is empty; needs numbers"),
    "ragged": (lambda: Gains([[1.0], [1.0, 2.0]], 1.0),
     "Gains: kp: ... different lengths [1, 2]"),
    "none": (lambda: Gains(None, 1.0), "Gains: ... both kp and kv"),
    "nothing": (lambda: Gains(), "Gains: ... either kp and kv"),
    "twice": (lambda: Gains(1.0, 1.0, natural_frequency=1.0),
     "Gains: ... either kp and kv ... damping_ratio"),
    "ratio alone": (lambda: Gains(damping_ratio=1.0), "Gains: ... either kp and kv"),
    "shape of kp": (lambda: Gains([1.0, 2.0], 1.0).matrices(3),
     "kp ... (2,) ... a number"),
    "shape of kv": (lambda: Gains(1.0, np.eye(2)).matrices(3),
     "kv ... (2, 2) ... a number"),
    "no decay": (lambda: Gains([[1.0, 3.0], [3.0, 1.0]], 1.0).matrices(2),
     "... does not decay ... 1 1/s"),
    "frequency matrix": (lambda: Gains(natural_frequency=np.eye(2) + 1.0),
     "Gains: natural_frequency ... numbers or lists"),
    "lists of different length": (
     lambda: Gains(natural_frequency=[1.0, 2.0], damping_ratio=[1.0, 1.0, 1.0]),
     "Gains: natural_frequency ... 2 ... damping_ratio 3"),
}  # fmt: skip


@pytest.mark.parametrize("which", GAIN_ERRORS)
def test_errors_of_gains(which: str) -> None:
    build, message = GAIN_ERRORS[which]
    with pytest.raises(GainError, match=wording(message)):
        build()
