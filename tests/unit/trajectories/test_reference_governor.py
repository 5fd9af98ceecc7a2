"""A streamed reference waits for a robot that cannot follow."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from hsp_control.trajectories import Stream, StreamOrientation, StreamPose
from hsp_control.trajectories.streams.governor import Lead

H = 1e-3
"""A control period [s]."""
LEAD = 0.1
BRAKING = 1.0**2 / (2 * 5.0) + 1.0 * (5.0 / 200.0) + 0.01 * 1.0
"""From 1 m/s with 5 m/s², until that builds up, and until it is seen [m]."""


def run(
    stream: Any,
    follow: Callable[[float, np.ndarray, np.ndarray], np.ndarray],
    duration: float,
    start: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Return references and the places of a robot that moves by ``follow``.

    Args:
        stream: A stream of a point.
        follow: From the time, the reference and the robot's place to its next place.
        duration: How long [s].
        start: Where the robot begins, shape (3,).
    """
    references, places = [], [start]
    for k in range(round(duration / H)):
        sample = stream.sample(k * H)
        x = sample.position.copy()
        references.append([x, sample.velocity.copy(), sample.acceleration.copy()])
        here = places[-1]
        stream.see(k * H, lambda x=x, here=here: (x, here))
        places.append(follow(k * H, x, here))
    return np.array(references), np.array(places)


def behind_a_wall(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
    return np.minimum(x, [0.3, np.inf, np.inf])


def exactly(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
    return x.copy()


def test_the_reference_stops_where_the_robot_cannot_follow() -> None:
    stream = Stream(np.zeros(3), policy="latest")
    stream.send([2.0, 0.0, 0.0])
    references, _ = run(stream, behind_a_wall, 3.0, np.zeros(3))
    ahead = references[:, 0, 0] - 0.3
    assert LEAD < ahead.max() < LEAD + BRAKING
    assert np.abs(references[-1, 1:]).max() < 1e-9  # and rests there
    assert stream.counts()["held_back"] == 1.0
    # It stays a C² function of time within its bounds.
    x, rate, acceleration = references[:, :, 0].T
    assert np.abs(rate).max() < 1.0 + 1e-9
    assert np.abs(acceleration).max() < 5.0 + 1e-9
    assert np.abs(np.diff(acceleration)).max() < 200.0 * H + 1e-9
    trapezia = H * (rate[1:] + rate[:-1]) / 2 - H * H * np.diff(acceleration) / 12
    assert np.abs(np.diff(x) - trapezia).max() < 200.0 * H**3 / 12 + 1e-12


def test_it_turns_back_at_once_and_not_after_the_way_it_would_have_gone() -> None:
    stream = Stream(np.zeros(3), policy="latest")
    stream.send([2.0, 0.0, 0.0])

    def follow(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
        if t == pytest.approx(3.0):
            stream.send([0.0, 0.0, 0.0])
        return behind_a_wall(t, x, here)

    _, places = run(stream, follow, 4.5, np.zeros(3))
    assert places[3000, 0] == pytest.approx(0.3)
    # From 1.7 m ahead the way back to the wall alone would have taken 1.9 s.
    assert places[3600, 0] < 0.29
    assert abs(places[-1, 0]) < 1e-6


def test_it_goes_on_when_the_robot_can_follow_again() -> None:
    stream = Stream(np.zeros(3), policy="latest")
    stream.send([1.0, 0.2, 0.0])

    def follow(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
        if t < 2.0:
            return behind_a_wall(t, x, here)
        return here + 0.02 * (x - here)  # with a time constant of 50 ms

    references, places = run(stream, follow, 5.0, np.zeros(3))
    assert np.abs(references[-1, 0] - [1.0, 0.2, 0.0]).max() < 1e-9
    assert np.abs(places[-1] - [1.0, 0.2, 0.0]).max() < 1e-3
    assert stream.counts()["held_back"] == 0.0


def test_a_target_that_moves_aside_is_followed_along_the_wall() -> None:
    stream = Stream(np.zeros(3), policy="latest")
    stream.send([2.0, 0.0, 0.0])

    def follow(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
        if t == pytest.approx(2.0):
            stream.send([2.0, 1.0, 0.0])
        return behind_a_wall(t, x, here)

    references, places = run(stream, follow, 8.0, np.zeros(3))
    assert places[-1, 0] == pytest.approx(0.3)
    # The nearest place to the target is at y = 1; the reference is ahead in x.
    assert places[-1, 1] == pytest.approx(1.0, abs=0.05)
    assert references[:, 0, 0].max() - 0.3 < LEAD + BRAKING


def test_a_force_does_not_take_the_reference_along() -> None:
    stream = Stream(np.zeros(3), policy="latest")
    stream.send([0.2, 0.0, 0.0])

    def follow(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
        return x if t < 2.0 else x - [0.0, 0.5, 0.0]

    references, _ = run(stream, follow, 3.0, np.zeros(3))
    assert np.abs(references[2000:, 0] - [0.2, 0.0, 0.0]).max() < 1e-9
    assert stream.counts()["held_back"] == 1.0


def test_a_robot_that_follows_is_never_waited_for() -> None:
    kept, free = (
        Stream(np.zeros(3), policy="latest", lead=lead) for lead in (LEAD, None)
    )
    for stream in (kept, free):
        stream.send([2.0, 0.5, -0.3])
    (ours, _), (others, _) = (
        run(stream, exactly, 3.0, np.zeros(3)) for stream in (kept, free)
    )
    assert (ours == others).all()


def test_without_a_lead_it_goes_as_far_as_it_was_told() -> None:
    stream = Stream(np.zeros(3), policy="latest", lead=None)
    stream.send([2.0, 0.0, 0.0])
    references, _ = run(stream, behind_a_wall, 4.0, np.zeros(3))
    assert references[-1, 0, 0] == pytest.approx(2.0)
    assert stream.counts()["held_back"] == 0.0


def test_a_velocity_is_held_back_and_its_silence_ends_the_motion() -> None:
    stream = Stream(np.zeros(3), extrapolation=0.2)

    def follow(t: float, x: np.ndarray, here: np.ndarray) -> np.ndarray:
        if t < 2.0 and round(t / H) % 20 == 0:
            stream.send(velocity=[0.5, 0.1, 0.0])
        return behind_a_wall(t, x, here)

    references, _ = run(stream, follow, 4.0, np.zeros(3))
    assert references[:, 0, 0].max() < 0.3 + LEAD + BRAKING
    assert np.abs(references[3000:, 1]).max() < 1e-9


def test_an_orientation_that_is_blocked_waits() -> None:
    stream = StreamOrientation(np.eye(3), angular_lead=0.3)
    stream.send(pin.Quaternion(pin.exp3(np.array([0.0, 0.0, 2.5]))).coeffs())
    still = np.array([0.0, 0.0, 0.0, 1.0])
    for k in range(3000):
        sample = stream.sample(k * H)
        stream.see(k * H, lambda: (still, still))
    angle = np.linalg.norm(pin.log3(sample.rotation))
    braking = 2.5**2 / (2 * 20.0 / np.sqrt(3.0)) + 2.5 * 0.05
    assert 0.3 < angle < 0.3 + braking
    assert np.abs(sample.angular_velocity).max() < 1e-9


def test_a_pose_waits_for_either_part() -> None:
    stream = StreamPose(position=np.zeros(3), rotation=np.eye(3))
    stream.send([0.8, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    still = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0])
    for k in range(2000):
        sample = stream.sample(k * H)
        stream.see(k * H, lambda: (still, still))
    assert LEAD < sample.position.position[0] < LEAD + BRAKING
    assert stream.counts()["held_back"] == 1.0


def test_a_goal_is_brought_no_nearer_than_the_reference_is() -> None:
    rng = np.random.default_rng(1)
    lead = Lead(1e-6, 1e-6, 3)
    for _ in range(200):
        goal, x, actual = rng.normal(size=(3, 6))
        nearer = lead.nearer_goal(goal, x, actual)
        for part in (slice(None, 3), slice(3, None)):
            ahead = np.linalg.norm(x[part] - actual[part])
            away, new = goal[part] - actual[part], nearer[part] - actual[part]
            assert np.linalg.norm(np.cross(away, new)) < 1e-12  # on the same line
            expected = min(np.linalg.norm(away), ahead)
            assert np.linalg.norm(new) == pytest.approx(expected, rel=1e-12)
