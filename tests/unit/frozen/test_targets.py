"""Targets set by a program move the reference as stream messages do in Python."""

from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from frozen_library import (
    LIB,
    NOT_FINITE,
    OK,
    WRONG_NAME,
    WRONG_SIZE,
    WRONG_VALUE,
    Opened,
)
from places import THOROUGH, covering

import hsp_control as hsp
from hsp_control.common.errors import FreezeError
from hsp_control.trajectories import Stream, StreamOrientation, StreamPose

SEED = 61
H = 0.001
HOW: dict[str, Any] = {"policy": "latest", "delay": 0.03}
ROBOT = hsp.Robot.load("panda")
Q = ROBOT.home()
_AT = ROBOT.state(0.0, Q, np.zeros(7)).frame("panda_tcp")
START = pin.SE3(_AT.rotation, _AT.position)


def tasks(kind: str) -> list[hsp.Task]:
    """Return one task, whose reference is streamed."""
    if kind == "pose":
        return [hsp.FramePose("panda_tcp", StreamPose(**HOW), name="hand")]
    if kind == "falls silent":
        how = {**HOW, "hold_after": 0.02}
        return [hsp.FramePose("panda_tcp", StreamPose(**how), name="hand")]
    if kind == "tool axes":
        how = {**HOW, "axes": "tool", "extrapolation": 0.02}
        return [hsp.FramePose("panda_tcp", StreamPose(**how), name="hand")]
    if kind in WAYPOINTS:
        how = {**HOW, **WAYPOINTS[kind]}
        return [hsp.FramePose("panda_tcp", StreamPose(**how), name="hand")]
    if kind == "position":
        return [hsp.FramePosition("panda_tcp", Stream(**HOW), name="hand")]
    turn = StreamOrientation(**HOW)
    return [hsp.FrameOrientation("panda_tcp", turn, name="hand")]


WAYPOINTS: dict[str, dict[str, Any]] = {
    "interpolate": {"policy": "interpolate"},
    "interpolate at once": {"policy": "interpolate", "delay": 0.0},
    "interpolate smoothly": {"policy": "interpolate", "smoothing": 0.04},
    "extrapolate": {"policy": "extrapolate", "extrapolation": 0.05},
    "extrapolate and rest": {"policy": "extrapolate", "hold_after": 0.07},
}
KINDS = "pose", "falls silent", "position", "orientation", "tool axes", *WAYPOINTS


class Pair:
    """A controller in Python, and the same without, at the beginning of a run."""

    def __init__(self, kind: str, folder: Path) -> None:
        given = tasks(kind)
        self.controller = hsp.Controller(ROBOT, given, hsp.JointCentering(), start=Q)
        self.opened = Opened(hsp.freeze(self.controller, folder / "frozen.hsp"))
        self.stream = self.controller.stream("hand")
        self.k = 0

    def target(self, value: np.ndarray, **given: Any) -> None:
        self.stream.send(value, **given)
        assert self.opened.set("hand.target", value) == OK

    def velocity(self, value: np.ndarray) -> None:
        self.stream.send(velocity=value)
        assert self.opened.set("hand.velocity", value) == OK

    def steps(self, count: int) -> np.ndarray:
        """Step both, compare the bits, and return the errors of the task."""
        found = []
        for _ in range(count):
            t, self.k = self.k * H, self.k + 1
            output = self.controller.compute(t, Q, np.zeros(7))
            self.controller.applied(output.tau, H)
            assert self.opened.step(t, Q, np.zeros(7)) == output.status
            np.testing.assert_array_equal(self.opened.tau, output.tau)
            found.append(self.controller.active_stack.rows.error.copy())
        return np.array(found)


def random_target(kind: str, rng: np.random.Generator, far: float) -> np.ndarray:
    moved = START * pin.exp6(pin.Motion(rng.uniform(-far, far, 6)))
    value = pin.SE3ToXYZQUAT(moved)
    value[3:] *= 1.0 + 1e-5 * rng.normal()  # rounding by the sender
    return {"position": value[:3], "orientation": value[3:]}.get(kind, value)


@pytest.mark.smoke
@pytest.mark.parametrize("kind", KINDS)
def test_targets_and_velocities_whenever_they_come(kind: str, tmp_path: Path) -> None:
    rng, pair = np.random.default_rng(SEED), Pair(kind, tmp_path)
    rates = len(
        pair.opened.get("hand.velocity", pair.opened.ports["hand.velocity"].size)
    )
    pair.target(random_target(kind, rng, 0.1))  # before the first step
    for far in (1e-4, 0.02, 0.3, 1.0):  # in a given time, and in the shortest one
        for _ in range(12 if THOROUGH else 6):
            for _ in range(rng.integers(3)):  # none, one, or two between two steps
                if rng.random() < 0.5:
                    pair.target(random_target(kind, rng, far))
                else:
                    pair.velocity(rng.normal(0.0, far, rates))
            pair.steps(int(rng.integers(1, 40)))


class Sender:
    """A program that sends by its own clock, which restarts at times."""

    def __init__(self, rng: np.random.Generator) -> None:
        self.rng, self.offset = rng, 1e3

    def time(self, t: float) -> float:
        """Return the time stamp of a message that arrives now, possibly late."""
        if self.rng.random() < 0.03:
            self.offset -= 5.0
        return t + self.offset - self.rng.exponential(0.01)


@pytest.mark.smoke
@pytest.mark.parametrize("kind", KINDS)
def test_targets_with_velocities_and_times(kind: str, tmp_path: Path) -> None:
    """Late ones, a sender's restarted clock, and velocities in the same period."""
    rng, pair = np.random.default_rng(SEED), Pair(kind, tmp_path)
    sender, rates = Sender(rng), pair.opened.ports["hand.velocity"].size

    def target(far: float) -> None:
        value, given = random_target(kind, rng, far), dict[str, Any]()
        if rng.random() < 0.5:
            given["velocity"] = rng.normal(0.0, 0.3 * far, rates)
            assert pair.opened.set("hand.target_velocity", given["velocity"]) == OK
        if rng.random() < 0.7:
            given["t"] = sender.time(pair.k * H)
            assert pair.opened.set("hand.target_time", given["t"]) == OK
        pair.target(value, **given)

    for far in (0.002, 0.05, 0.5):
        for _ in range(40 if THOROUGH else 8):
            orders = ["", "t", "t", "t", "v", "tv", "vt", "vtv", "tt", "ttvtt"]
            for each in orders[rng.integers(len(orders))]:
                if each == "t":
                    target(far)
                else:
                    pair.velocity(rng.normal(0.0, far, rates))
            pair.steps(int(rng.integers(1, 25)))
    assert kind in ("position", "orientation") or pair.stream.counts()["late"] > 0


def test_a_moving_target_is_passed_with_its_velocity(tmp_path: Path) -> None:
    """At the sender's times, although messages arrive late."""
    pair = Pair("extrapolate", tmp_path)
    rng, speed = np.random.default_rng(SEED), 0.1
    for k in range(0, 300, 10):
        pair.steps(int(rng.integers(1, 5)))
        moved = pin.SE3(
            START.rotation, START.translation + np.array([1e-3 * k * speed, 0, 0])
        )
        rate, t = np.array([speed, 0.0, 0.0, 0.0, 0.0, 0.0]), 50.0 + 1e-3 * k
        assert pair.opened.set("hand.target_time", t) == OK
        assert pair.opened.set("hand.target_velocity", rate) == OK
        pair.target(pin.SE3ToXYZQUAT(moved), velocity=rate, t=t)
        pair.steps(k + 10 - pair.k)
    errors = pair.steps(20)[:, 0]
    np.testing.assert_allclose(np.diff(errors), speed * H, rtol=1e-6)


def test_a_velocity_that_is_repeated_fades_when_it_is_not(tmp_path: Path) -> None:
    pair = Pair("pose", tmp_path)
    pair.steps(2)
    for _ in range(10):
        pair.velocity(np.array([0.1, 0.0, 0.0, 0.0, 0.3, 0.0]))
        pair.steps(20)
    errors = pair.steps(400)
    np.testing.assert_array_equal(errors[-1], errors[-100])
    assert errors[-1, 0] > 0.015  # 0.1 m/s for 0.2 s, and the fading afterwards


@pytest.mark.parametrize(("kind", "every"), covering(WAYPOINTS, [1, 4, 16]))
def test_a_hand_that_moves_is_followed_through_its_waypoints(
    kind: str, every: int, tmp_path: Path
) -> None:
    """Until the sender stops; at a step more messages than the delay's may wait."""
    pair = Pair(kind, tmp_path)
    for k in range(0, 400, every):
        moved = np.array([0.05 * np.sin(0.005 * k), 1e-4 * k, 0.0, 0.0, 0.001 * k, 0])
        pair.target(pin.SE3ToXYZQUAT(START * pin.exp6(pin.Motion(moved))))
        pair.steps(every)
    there = pair.steps(600)[-1, :3]
    goal = START * pin.exp6(pin.Motion(moved))
    beyond = 0.02 if "extrapolate" in kind else 1e-9
    np.testing.assert_allclose(
        there, goal.translation - START.translation, rtol=0.0, atol=beyond
    )


def test_a_velocity_that_comes_in_the_very_step_in_which_it_fades(
    tmp_path: Path,
) -> None:
    pair = Pair("pose", tmp_path)
    pair.steps(2)
    for _ in range(4):
        pair.velocity(np.array([0.1, 0.0, 0.0, 0.0, 0.3, 0.0]))
        pair.steps(100)
    errors = pair.steps(1)
    assert errors[-1, 0] > 0.035  # it did not come to rest in between


def test_a_target_is_reached_at_rest(tmp_path: Path) -> None:
    pair = Pair("pose", tmp_path)
    goal = pin.SE3(START.rotation, START.translation + np.array([0.05, -0.1, 0.02]))
    pair.steps(1)
    pair.target(pin.SE3ToXYZQUAT(goal))
    errors = pair.steps(1200)
    np.testing.assert_allclose(errors[-1, :3], [0.05, -0.1, 0.02], atol=1e-12)


def test_a_new_run_begins_anew(tmp_path: Path) -> None:
    pair = Pair("position", tmp_path)
    pair.steps(2)
    pair.target(START.translation + 0.1)
    first = pair.steps(50)
    assert LIB.hsp_restart(pair.opened.handle) == OK
    pair.controller.restart()
    pair.k = 0
    pair.steps(2)
    pair.target(START.translation + 0.1)
    np.testing.assert_array_equal(pair.steps(50), first)


@pytest.mark.parametrize(
    ("name", "values", "duration", "status"),
    [
        ("hand.target", [0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 1.1], 0.0, WRONG_VALUE),
        ("hand.target", [0.5, 0.0, np.nan, 0.0, 0.0, 0.0, 1.0], 0.0, WRONG_VALUE),
        ("hand.target", [0.5, 0.0, 2e6, 0.0, 0.0, 0.0, 1.0], 0.0, WRONG_VALUE),
        ("hand.target", [0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], 0.1, WRONG_VALUE),
        ("hand.target", [0.5, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0], -0.1, WRONG_VALUE),
        ("hand.target", [0.5, 0.0, 0.5], 0.0, WRONG_SIZE),
        ("hand.velocity", [np.inf, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, WRONG_VALUE),
        ("hand.velocity", np.zeros(7), 0.0, WRONG_SIZE),
        ("hand.target_velocity", [np.nan, 0.0, 0.0, 0.0, 0.0, 0.0], 0.0, WRONG_VALUE),
        ("hand.target_velocity", np.zeros(6), 0.1, WRONG_VALUE),
        ("hand.target_time", [np.inf], 0.0, WRONG_VALUE),
        ("hand.target_time", [2e12], 0.0, WRONG_VALUE),
        ("hand.target_time", [1.0, 2.0], 0.0, WRONG_SIZE),
        ("elbow.target", np.zeros(7), 0.0, WRONG_NAME),
    ],
)
@pytest.mark.parametrize("kind", ["pose", "interpolate"])
def test_a_wrong_target_changes_nothing(
    kind: str, name: str, values: Any, duration: float, status: int, tmp_path: Path
) -> None:
    pair = Pair(kind, tmp_path)
    pair.target(random_target(kind, np.random.default_rng(SEED), 0.02))
    pair.steps(3)
    assert pair.opened.ramp(name, values, duration) == status
    assert pair.opened.error
    pair.steps(5)


def test_a_target_that_no_motion_reaches(tmp_path: Path) -> None:
    """As in Python, the stream comes to rest and counts the lost message."""
    pair = Pair("position", tmp_path)
    pair.steps(2)
    pair.target(np.array([9e5, 0.0, 0.0]))
    pair.steps(60)
    assert pair.stream.counts()["rejected"] == 1


@pytest.mark.parametrize(
    ("stream", "key"),
    [
        (StreamPose(source="udp://127.0.0.1:9", **HOW), "source"),
        (StreamPose(messages=[], **HOW), "messages"),
    ],
)
def test_inputs_that_a_program_cannot_give_are_refused(
    stream: Any, key: str, tmp_path: Path
) -> None:
    hand = hsp.FramePose("panda_tcp", stream, name="hand")
    controller = hsp.Controller(ROBOT, [hand], start=Q)
    with pytest.raises(FreezeError, match=rf"^tasks\.hand\.trajectory\.{key}: "):
        hsp.freeze(controller, tmp_path / "frozen.hsp")


def test_no_message_for_too_long_is_an_error_until_the_next_one(tmp_path: Path) -> None:
    stream = StreamPose(stop_after=0.05, **HOW)
    hand = hsp.FramePose("panda_tcp", stream, name="hand")
    controller = hsp.Controller(ROBOT, [hand], start=Q)
    opened = Opened(hsp.freeze(controller, tmp_path / "frozen.hsp"))
    for k in range(51):
        assert opened.step(k * H, Q, np.zeros(7)) == OK
    last = opened.tau.copy()
    assert opened.step(51 * H, Q, np.zeros(7)) == NOT_FINITE
    np.testing.assert_array_equal(opened.tau, last)
    assert opened.set("hand.target", pin.SE3ToXYZQUAT(START)) == OK
    assert opened.step(52 * H, Q, np.zeros(7)) == OK


def test_of_many_messages_in_a_period_the_last_eight_are_followed(
    tmp_path: Path,
) -> None:
    pair, rng = Pair("interpolate", tmp_path), np.random.default_rng(SEED)
    pair.steps(2)
    for _ in range(5):
        first = random_target("pose", rng, 0.3)
        assert pair.opened.set("hand.target", first) == OK
    for _ in range(8):
        pair.target(random_target("pose", rng, 0.3))
    pair.steps(50)


def test_a_stream_is_not_taken_from_who_has_it(tmp_path: Path) -> None:
    """Freezing reads no message, and earlier messages are not in the file."""
    pair = Pair("position", tmp_path)
    pair.stream.send(START.translation + 0.1)
    before = hsp.freeze(pair.controller, tmp_path / "first.hsp").read_bytes()
    assert before == (tmp_path / "frozen.hsp").read_bytes()
    pair.steps(1)
    assert pair.opened.set("hand.target", START.translation + 0.1) == OK
    pair.steps(20)
