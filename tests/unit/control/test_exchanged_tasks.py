"""A task that comes while another one goes: the step is the mean of both laws."""

from collections.abc import Callable
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from places import covering

import hsp_control as hsp
from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.trajectories.schedule import smooth_step

H, BEGIN, RAMP = 1e-3, 0.5, 0.4
METRICS: dict[str, Callable[[], hsp.metrics.Metric]] = {
    "I": hsp.metrics.IdentityMetric,
    "M": hsp.metrics.MassMatrixMetric,
}


def circling(**of: object) -> hsp.FramePosition:
    """Return a hand that moves on a circle."""
    circle = hsp.Circle(0.05, 2.0)
    return hsp.FramePosition(name="hand", trajectory=circle, **of)


def as_pose() -> hsp.FramePose:
    """Return the same circle, with an orientation that is held."""
    circle = hsp.trajectories.ComposedPose(position=hsp.Circle(0.05, 2.0))
    return hsp.FramePose(name="hand", trajectory=circle)


NEW: dict[str, Callable[[], hsp.Task]] = {
    "of other gains": lambda: circling(gains=hsp.Gains(natural_frequency=15.0)),
    "that holds more": as_pose,
}


@pytest.mark.parametrize(
    ("arm", "metric", "new"), covering(["panda", "iiwa14"], METRICS, NEW)
)
def test_what_both_control_keeps_its_error_equation(
    arm: str, metric: str, new: str
) -> None:
    """The hand stays on its circle; 5 to 8 mm were lost where neither task was there.

    An effort that is held for 1 ms costs 0.01 to 0.09 mm.
    """
    robot, of = hsp.Robot.load(arm), METRICS[metric]()
    made = hsp.Controller(robot, [circling(blend=0.4)], hsp.JointCentering(), metric=of)
    made.at(BEGIN).ramp(RAMP).remove("hand").add(NEW[new]())
    log = hsp.simulate(made, robot.home(), duration=1.2, control_period=H)
    errors = [log[x][:, :3] for x in ("task.hand.error", "task.hand_2.error")]
    there = [np.isfinite(each).all(axis=1) for each in errors]
    assert np.any(there, axis=0).all()
    away = np.array([np.linalg.norm(each, axis=1) for each in errors])
    assert np.nanmax(away[:, log.t > BEGIN]) < 1.5e-4


def test_schedules_exchange_tasks_likewise() -> None:
    """One ends with the ramp with which the other one begins."""
    robot, Schedule = hsp.Robot.load("panda"), hsp.trajectories.Schedule
    first = circling(blend=0.4, schedule=Schedule([(None, 0.9)], ramp=RAMP))
    second = circling(
        gains=hsp.Gains(natural_frequency=15.0),
        schedule=Schedule([(0.5, None)], ramp=RAMP),
    )
    tasks = [first, replace(second, name="second")]
    made = hsp.Controller(robot, tasks, hsp.JointCentering())
    log = hsp.simulate(made, robot.home(), duration=1.2, control_period=H)
    errors = [log[x] for x in ("task.hand.error", "task.second.error")]
    there = [np.isfinite(each).all(axis=1) for each in errors]
    fading = (log.t > BEGIN + 2 * H) & (log.t < BEGIN + RAMP - 2 * H)
    np.testing.assert_array_equal(np.all(there, axis=0)[fading], True)
    away = np.array([np.linalg.norm(each, axis=1) for each in errors])
    assert np.nanmax(away[:, log.t > BEGIN]) < 1.5e-4


INTERVALS = [(None, 1.0), (1.0, 2.0), (2.5, None)]


@pytest.mark.parametrize("ramp", [0.0, 0.3])
def test_an_interval_is_as_long_as_the_weight(ramp: float) -> None:
    """It begins at 0 and ends at 1, with a rise that ends before the fall begins."""
    schedule = hsp.trajectories.Schedule(INTERVALS, ramp=ramp)
    times = np.linspace(0.0, 4.0, 4001)
    low, high = np.array([schedule.interval(t) for t in times]).T
    weight = np.array([schedule.weight(t) for t in times])
    np.testing.assert_allclose(high - low, weight, rtol=0, atol=1e-14)
    assert not np.any((low > 0.0) & (high < 1.0))
    falling = (times > 0.71) & (times < 1.0)
    assert np.all(low[falling] > 0.0) == (ramp > 0.0)


def point(offset: Array, name: str = "hand") -> hsp.FramePosition:
    """Return a hand whose target is beside the start."""
    return hsp.FramePosition(name=name, trajectory=hsp.Hold(offset, origin="start"))


ROBOT = hsp.Robot.load("panda")
OLD, NEXT = np.array([0.02, 0.0, 0.0]), np.array([0.0, 0.03, 0.01])


@pytest.mark.parametrize("name", ["hand", "other"])
def test_the_effort_is_the_mean_of_both(name: str) -> None:
    """Also of tasks with different names: (1 - s) d{old} + s d{new}."""

    def alone(task: hsp.Task) -> Array:
        made = hsp.Controller(ROBOT, [task], hsp.JointCentering(), start=ROBOT.home())
        return made.compute(0.0, q, v).tau

    q, v = ROBOT.home() + 0.01 * np.arange(7.0), 0.1 * np.cos(np.arange(7.0))
    made = hsp.Controller(ROBOT, [point(OLD)], hsp.JointCentering(), start=ROBOT.home())
    made.at(0.1).ramp(0.2).remove("hand").add(point(NEXT, name))
    made.compute(0.0, ROBOT.home(), np.zeros(7))
    for t in (0.13, 0.2, 0.26):
        s = smooth_step(t, 0.1, 0.2)[0]
        mean = (1.0 - s) * alone(point(OLD)) + s * alone(point(NEXT, name))
        np.testing.assert_allclose(made.compute(t, q, v).tau, mean, rtol=1e-12)


def test_one_that_comes_slower_leaves_nothing_between() -> None:
    """What has gone is not yet replaced: a part of the arm is led by neither."""
    made = hsp.Controller(ROBOT, [point(OLD)], hsp.JointCentering())
    made.at(0.1).ramp(0.1).remove("hand")
    made.at(0.1).ramp(0.2).add(point(NEXT))
    made.compute(0.0, ROBOT.home(), np.zeros(7))
    made.compute(0.15, ROBOT.home(), np.zeros(7))
    assert [len(each.stacked) for each in made.stacks] == [0, 1, 1]
    assert made.weight_of("hand", 0.15) == pytest.approx(0.103515625)


def test_one_that_was_removed_before_it_was_there_shrinks_from_both_sides() -> None:
    """Without a jump, as fast as its changes say."""
    made = hsp.Controller(ROBOT, [], hsp.JointCentering())
    made.at(0.1).ramp(0.2).add(point(NEXT))
    made.at(0.15).ramp(0.2).remove("hand")
    made.compute(0.0, ROBOT.home(), np.zeros(7))
    times = np.linspace(0.1, 0.36, 2001)
    q, v = ROBOT.home(), np.zeros(7)
    efforts = np.array([made.compute(t, q, v).tau for t in times])
    # The largest slope of both steps, 1.9/0.2 a second, times what the task commands.
    own = hsp.Controller(ROBOT, [point(NEXT)], hsp.JointCentering(), start=q)
    free = hsp.Controller(ROBOT, [], hsp.JointCentering(), start=q)
    whole = np.abs(own.compute(0.0, q, v).tau - free.compute(0.0, q, v).tau).max()
    step = np.abs(np.diff(efforts, axis=0)).max()
    assert 0.0 < step < 2.0 * 1.9 / 0.2 * (times[1] - times[0]) * whole
    np.testing.assert_allclose(efforts[-1], free.compute(1.0, q, v).tau, rtol=1e-12)


ENDS = st.sampled_from([0.0, 0.25, 0.5, 0.75, 1.0]) | st.floats(0.0, 1.0)


@given(st.lists(st.tuples(ENDS, ENDS), max_size=5), st.data())
def test_a_share_is_the_length_of_where_a_set_is_active(
    intervals: list[tuple[float, float]], data: st.DataObject
) -> None:
    """Looked at between any two ends; and a set that is not there is missed."""
    k = len(intervals)
    lows, highs = np.array(intervals, dtype=float).reshape(k, 2).T.copy()
    members = np.arange(1 << k)[:, None] >> np.arange(k) & 1
    on, shares = np.zeros(1 << k, dtype=np.int64), np.zeros(1 << k)
    call = engine.ChooseSets(
        lows=lows, highs=highs, members=members.astype(np.int64), on=on, shares=shares
    )
    assert call()
    shorter = 1e-12  # is rounding, and has no share
    most = (2 * k + 1) * shorter
    assert shares.sum() == pytest.approx(1.0, abs=most)
    np.testing.assert_array_equal(on == 1, shares > 0.0)
    ends = np.unique([0.0, 1.0, *lows, *highs])
    expected = np.zeros(1 << k)
    for low, high in pairwise(ends):
        u = 0.5 * (low + high)
        active = (lows < u) & (u < highs)
        expected[np.dot(active, 1 << np.arange(k))] += high - low
    np.testing.assert_allclose(shares, expected, rtol=0, atol=most)
    needed = np.flatnonzero(on)
    left_out = data.draw(st.sampled_from(needed.tolist()))
    some = np.delete(members, left_out, axis=0).astype(np.int64)
    fewer, less = np.ones(len(some), dtype=np.int64), np.ones(len(some))
    call = engine.ChooseSets(
        lows=lows, highs=highs, members=some, on=fewer, shares=less
    )
    assert not call()
    assert not fewer.any()
    assert not less.any()
