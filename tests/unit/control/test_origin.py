"""Times are relative to the first step, for any reading of the robot's clock."""

import copy
import pickle
import threading
from collections.abc import Callable

import numpy as np
import pytest

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.common.errors import NonFiniteError

H = 2.0**-9
"""Period [s] for which t - t0 has the same bits at all of these clocks."""
CLOCKS = [0.0, 2.0**14, -(2.0**20), 2.0**30 + 2.0**29]
ROBOT = hsp.Robot.load("panda")


def controller() -> hsp.Controller:
    """Return a controller with a circle, a schedule and a change."""
    circle = hsp.Circle(radius=0.1, angular_rate=2.0)
    hand = hsp.FramePosition(trajectory=circle, blend=0.5, name="hand")
    schedule = hsp.trajectories.Schedule([(0.1, 0.4)], ramp=0.1)
    turned = hsp.FrameOrientation(schedule=schedule, priority=2, name="turned")
    field, start = hsp.TargetPosture("home"), ROBOT.home()
    made = hsp.Controller(ROBOT, [hand, turned], field, limits=None, start=start)
    made.at(0.2).ramp(0.1).gains("hand", hsp.Gains(natural_frequency=15.0))
    return made


def posture(k: int) -> tuple[Array, Array]:
    """Return q and v of a step."""
    phase = 0.02 * k + np.arange(7.0)
    return ROBOT.home() + 0.01 * np.sin(phase), 2e-4 / H * np.cos(phase)


def efforts(made: hsp.Controller, clock: float, steps: range) -> Array:
    """Return the efforts of steps at a clock that reads ``clock`` at step 0."""
    found = []
    for k in steps:
        found.append(made.compute(clock + k * H, *posture(k)).tau)
        made.applied(found[-1], H)
    return np.array(found)


STEPS = range(0, 280, 4)
USUAL = efforts(controller(), 0.0, STEPS)


@pytest.mark.parametrize("clock", CLOCKS)
def test_a_clock_may_begin_anywhere(clock: float) -> None:
    made = controller()
    np.testing.assert_array_equal(efforts(made, clock, STEPS), USUAL)
    assert made.state.t == STEPS[-1] * H
    made.restart()  # with another clock
    np.testing.assert_array_equal(efforts(made, 5.0, STEPS), USUAL)


def test_the_first_step_of_a_clock_is_near_gravity() -> None:
    """Blend and circle begin at the first step, not at the clock's zero."""
    q, rest = ROBOT.home(), np.zeros(7)
    gravity = ROBOT.inverse_dynamics(q, rest, rest)
    tau = controller().compute(1.76e9, q, rest).tau
    np.testing.assert_allclose(tau, gravity, rtol=0, atol=1e-9)


def pickled(made: hsp.Controller) -> hsp.Controller:
    """Return a pickle that was loaded."""
    again: hsp.Controller = pickle.loads(pickle.dumps(made))
    return again


@pytest.mark.parametrize("copied", [copy.copy, copy.deepcopy, pickled])
@pytest.mark.parametrize("clock", CLOCKS)
def test_a_copy_goes_on_with_the_same_clock(
    copied: Callable[[hsp.Controller], hsp.Controller], clock: float
) -> None:
    made = controller()
    efforts(made, clock, STEPS[:20])
    found = efforts(copied(made), clock, STEPS[20:])
    np.testing.assert_array_equal(found, USUAL[20:])


def test_any_thread_may_make_the_first_step() -> None:
    made, found, clock = controller(), list[Array](), CLOCKS[-1]

    def first() -> None:
        found.append(efforts(made, clock, STEPS[:1]))

    thread = threading.Thread(target=first)
    thread.start()
    thread.join()
    found.append(efforts(made, clock, STEPS[1:]))
    np.testing.assert_array_equal(np.vstack(found), USUAL)


def test_a_given_origin_is_used() -> None:
    """Set to a clock's time before the first step; None resets it."""
    made, later = controller(), STEPS[20:]
    made.restart(origin=100.0)
    np.testing.assert_array_equal(efforts(made, 100.0, later), USUAL[20:])
    made.restart()
    assert not np.array_equal(efforts(made, 100.0, later), USUAL[20:])
    made.restart(origin=100.0)  # while it runs
    np.testing.assert_array_equal(efforts(made, 100.0, later), USUAL[20:])
    with pytest.raises(NonFiniteError, match="origin is inf; needs a finite number"):
        made.restart(origin=np.inf)
    made.compute(1e3, *posture(0))
    assert made.state.t == 900.0  # refused calls have no effect


def test_a_state_has_the_time_since_the_first_step() -> None:
    """At any clock, for the controller and any other one of its robot."""
    made = controller()
    efforts(made, CLOCKS[-1], STEPS[:20])
    k = STEPS[20]
    own = made.compute(made.state.update(k * H, *posture(k))).tau
    np.testing.assert_array_equal(own, USUAL[20])
    other = made.compute(ROBOT.state(k * H, *posture(k))).tau
    np.testing.assert_array_equal(other, USUAL[20])
    clocked = made.compute(CLOCKS[-1] + k * H, *posture(k)).tau
    np.testing.assert_array_equal(clocked, USUAL[20])


@pytest.mark.parametrize("begun", [False, True])
def test_looking_ahead_moves_nothing(begun: bool) -> None:
    """Times of the flow and of the rows are relative to the first step, too."""
    made, usual, clock = controller(), controller(), CLOCKS[-1]
    if begun:
        efforts(made, clock, STEPS[:20])
        efforts(usual, 0.0, STEPS[:20])
    q, rest = posture(3)[0], np.zeros(7)
    rows, v = made.stack(ROBOT.state(0.3, q, rest)), made.flow(0.3, q)
    expected = usual.compute(ROBOT.state(0.3, q, rest)).task
    np.testing.assert_array_equal(rows.jacobian, expected.jacobian)
    np.testing.assert_array_equal(rows.error, expected.error)
    np.testing.assert_allclose(v, usual.flow(0.3, q), rtol=0, atol=1e-14)
    following = STEPS[20:] if begun else STEPS
    found = efforts(made, clock, following)
    np.testing.assert_array_equal(found, USUAL[-len(following) :])
