"""Out of reach, levels keep their order and the arm comes to rest."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load
from places import further
from task_cases import FRAMES

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.trajectories import HoldOrientation

PERIOD = 0.005
SHORT = 0.02  # 1 to 8 mm; without the rule of `threshold_below` 160 to 510 mm


def rests_at(name: str, q0: Array, away: Array, *below: hsp.Task) -> float:
    """Return the hand's distance from its target, at rest."""
    robot, frame = load(name), FRAMES[name]
    goal = robot.state(0.0, q0, np.zeros(robot.nv)).position(frame) + away
    tasks = [hsp.FramePosition(frame, hsp.Hold(goal)), *below]
    made = hsp.Controller(robot, tasks, hsp.JointCentering(), start=q0)
    run = hsp.simulate(made, q0, duration=5, control_period=PERIOD, log_period=PERIOD)
    left = goal - robot.state(0.0, run.q[-1], np.zeros(robot.nv)).position(frame)
    changes = np.abs(np.diff(run.tau[-200:], axis=0)).max(axis=0)
    share = changes / robot.model.effortLimit * (1e-3 / PERIOD)
    assert share.max() <= 1e-3
    return float(np.linalg.norm(left))


@pytest.mark.parametrize("name", ["ur5", *further("panda")])
def test_the_hand_is_as_near_as_possible_for_any_lower_demand(name: str) -> None:
    """A position half a metre out of reach, above an orientation, above a posture."""
    robot, q0 = load(name), load(name).home()
    start = robot.state(0.0, q0, np.zeros(robot.nv)).frame(FRAMES[name])
    away = 1.5 * np.array([0.6, 0.5, 0.6]) / np.linalg.norm([0.6, 0.5, 0.6])
    turned = HoldOrientation(start.rotation @ pin.exp3(np.array([0.0, 0.8, 0.0])))
    second = hsp.FrameOrientation(FRAMES[name], turned, priority=2)
    third = hsp.JointPosture(q0, priority=3)
    alone = rests_at(name, q0, away)
    for below in ([second], [second, third]):
        assert rests_at(name, q0, away, *below) - alone <= SHORT


def test_an_orientation_without_error_yields_too() -> None:
    """It demands nothing, but would oppose the motion of the position above it."""
    q0 = np.array([-0.019, -1.491, 1.837, -2.484, -1.32, -0.043])
    away = np.array([-1.993, -0.799, 0.043])
    below = hsp.FrameOrientation(FRAMES["ur5"], priority=2)
    alone = rests_at("ur5", q0, away)
    assert rests_at("ur5", q0, away, below) - alone <= SHORT  # it was 0.25 m


@pytest.mark.parametrize(
    ("name", "away"),
    [("panda", [0.283, -0.298, 1.443]), ("ur5", [0.466, 1.109, 0.895])],
)
def test_an_orientation_below_a_spring_out_of_reach_rests(
    name: str, away: list[float]
) -> None:
    """A slipping spring saturates its level, too."""
    robot, frame = load(name), FRAMES[name]
    here = robot.state(0.0, robot.home(), np.zeros(robot.nv)).position(frame)
    spring = hsp.Impedance(600.0)
    hand = hsp.FramePosition(frame, hsp.Hold(here + np.array(away)), impedance=spring)
    below = hsp.FrameOrientation(frame, priority=2)
    assert rests(robot, robot.home(), hand, below, period=PERIOD)


def test_a_spring_above_an_orientation_rests_where_a_joint_is_at_its_limit() -> None:
    """It oscillated at 8.5 Hz with directions that springs release from 0.4 size on."""
    q0 = np.array([-0.2527, 0.469, -0.1675, -1.8041, 0.0461, 0.8357, 0.2226])
    goal, frame = [0.3359, -0.151, -0.899], load("iiwa14").end_effector
    hand = hsp.FramePosition(frame, hsp.Hold(goal), impedance=hsp.Impedance(126.8))
    below = hsp.FrameOrientation(frame, priority=2)
    assert rests(load("iiwa14"), q0, hand, below, period=0.01)


@pytest.mark.parametrize(
    ("q0", "goal"),
    [
        # joints are at their limits, and the hand does not reach the goal
        ([-0.27, -0.68, 0.26, -2.46, -0.06, 1.82, 1.04], [0.161, -0.535, -0.443]),
        # the position yielded to the orientation, recovered, and yielded again
        ([0.29, -0.99, 0.17, -2.62, 0.14, 1.37, 0.63], [0.301, 0.909, 0.327]),
    ],
    ids=["limits", "by turns"],
)
def test_a_hand_just_out_of_reach_rests_above_an_orientation(
    q0: list[float], goal: list[float]
) -> None:
    """It demands little, and the levels below it much."""
    hand = hsp.FramePosition("panda_tcp", hsp.Hold(goal))
    below = hsp.FrameOrientation("panda_tcp", priority=2)
    assert rests(load("panda"), np.array(q0), hand, below, period=PERIOD)


def test_a_centre_of_mass_out_of_reach_rests() -> None:
    """On a fixed base it is no balance task: its threshold adapts as any other's."""
    robot, rng = load("panda"), np.random.default_rng(0)
    q0 = robot.home() + rng.uniform(-0.3, 0.3, robot.nv)
    here = robot.state(0.0, q0, np.zeros(robot.nv)).centroidal.position
    task = hsp.CenterOfMass(hsp.Hold(here + 0.5 * rng.normal(size=3)))
    assert rests(robot, q0, task, period=PERIOD)


@pytest.mark.parametrize("name", ["panda", *further("ur5")])
def test_a_height_out_of_reach_rests(name: str) -> None:
    """All joints lift the hand, against the inertia of the whole arm."""
    robot = load(name)
    task = hsp.FramePosition(FRAMES[name], hsp.Hold([2.0]), axes="z")
    assert rests(robot, robot.home(), task, period=PERIOD)


def test_a_field_does_not_shake_an_arm_that_a_spring_holds_stretched() -> None:
    """It demands a flexed posture; there are no effort or joint limits."""
    robot = load("planar3r")  # of 3 kg and 3 m: 100 1/s² at an error of 0.9 m
    assert robot.spring_force == pytest.approx((270.0, 270.0 * 1.5 / 2.0))
    q0 = robot.integrate(robot.neutral(), np.array([0.1, 0.6, 0.6]))
    spring = hsp.Impedance(300.0)
    hand = hsp.FramePosition("tip", hsp.Hold([3.0, 3.0]), axes="xy", impedance=spring)
    made = hsp.Controller(robot, [hand], hsp.TargetPosture(q0))
    run = hsp.simulate(made, q0, duration=5.0, control_period=0.005)
    assert np.abs(run.v[-1]).max() < 1e-6


def test_no_joint_compensates_for_others_at_any_speed() -> None:
    """Three joints without limits in the URDF, with motors overloaded by gravity."""
    robot = hsp.Robot.load("bravo7_no_ee")  # it was 1e18 rad/s after 30 ms
    made = hsp.Controller(robot, [hsp.FramePose(robot.end_effector)])
    run = hsp.simulate(made, robot.home(), duration=1.0, control_period=1e-3)
    assert np.abs(run.v[:, [0, 3, 5]]).max() < 0.5  # the largest of the others


def rests(robot: hsp.Robot, q0: Array, *tasks: hsp.Task, period: float = 1e-3) -> bool:
    """Return whether no effort changes by more than 1e-3 of its limit in 1 ms."""
    how: Any = {"duration": 6.0, "control_period": period, "log_period": period}
    made = hsp.Controller(robot, tasks, hsp.JointCentering(), start=q0)
    run = hsp.simulate(made, q0, **how)
    changes = np.abs(np.diff(run.tau[-round(1.0 / period) :], axis=0)).max(axis=0)
    return bool((changes <= period * robot.model.effortLimit).all())
