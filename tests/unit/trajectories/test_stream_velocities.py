"""Streamed velocities, as from a joystick: exact integrals, bounds, silence."""

import json
from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import THOROUGH

from hsp_control.common.errors import StreamError, TrajectoryError
from hsp_control.trajectories import (
    PoseSample,
    Stream,
    StreamOrientation,
    StreamPose,
)

H = 1e-3
"""Time between samples [s]."""
START = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.9])), np.array([0.4, 0.0, 0.5]))
TWIST = np.array([0.1, 0.03, -0.05, 0.3, -0.6, 0.4])
AXES = ("world", "tool")


def run(
    stream: Any, duration: float, feed: Callable[[int], object] = lambda k: None
) -> list[Any]:
    """Return samples 1 ms apart; ``feed`` sends the messages before every sample."""
    samples = []
    for k in range(round(duration / H) + 1):
        feed(k)
        samples.append(stream.sample(k * H))
    return samples


def held(
    stream: Any, velocity: Any, first: int, last: int, every: int = 20
) -> Callable[[int], None]:
    """Return a feed of one velocity, as of a held stick, in samples."""

    def feed(k: int) -> None:
        if first <= k < last and (k - first) % every == 0:
            stream.run.send(velocity=velocity)

    return feed


def pose(sample: PoseSample) -> pin.SE3:
    return pin.SE3(sample.orientation.rotation, sample.position.position)


def twist(sample: PoseSample, axes: str) -> np.ndarray:
    """Return a sample's velocity in world axes, or in those of the body."""
    R = sample.orientation.rotation if axes == "tool" else np.eye(3)
    omega = sample.orientation.angular_velocity
    return np.concatenate([R.T @ sample.position.velocity, R.T @ omega])


def assert_integral(stream: Any, times: np.ndarray) -> None:
    """Check that x and R are integrals of x' and ω, and these of x'' and ω'.

    For a C² motion with jerk at most j, differences over ±h have an error of at most j
    h/3 in x'' and of j h²/6 in x'; for R a term of the commutator is of the same order.
    h is 10 µs.
    """
    h = 1e-5
    for t in times:
        before, here, after = (stream.sample(t + d) for d in (-h, 0.0, h))
        ahead, behind = pose(after), pose(before)
        x = (ahead.translation - behind.translation) / (2 * h)
        assert np.abs(x - here.position.velocity).max() < 1e-7
        turned = pin.log3(ahead.rotation @ behind.rotation.T) / (2 * h)
        assert np.abs(turned - here.orientation.angular_velocity).max() < 1e-6
        rate = (after.position.velocity - before.position.velocity) / (2 * h)
        assert np.abs(rate - here.position.acceleration).max() < 400 * h
        one, other = (each.orientation for each in (after, before))
        rate = (one.angular_velocity - other.angular_velocity) / (2 * h)
        assert np.abs(rate - here.orientation.angular_acceleration).max() < 2000 * h


@pytest.mark.parametrize("axes", AXES)
def test_a_stick_that_is_held_moves_the_hand_at_its_velocity(axes: Any) -> None:
    stream = StreamPose(axes=axes).anchored(START)
    other = held(stream, 0.5 * np.roll(TWIST, 1), 0, 200)
    stick = held(stream, TWIST, 200, 1000)
    samples = run(stream, 1.0, lambda k: (other(k), stick(k)))
    for sample in samples[302:]:  # ``delay`` after the first message
        # To rounding: the transition ends at exactly the commanded velocity.
        assert np.abs(twist(sample, axes) - TWIST).max() < 1e-12
        assert np.abs(sample.orientation.angular_acceleration).max() < 1e-12
    moved = pose(samples[500]).actInv(pose(samples[1000]))
    if axes == "tool":  # along a screw, exactly
        away = (moved.inverse() * pin.exp6(0.5 * TWIST)).np - np.eye(4)
        assert np.abs(away).max() < 1e-12
    else:
        R = samples[500].orientation.rotation
        assert np.abs(R @ moved.translation - 0.5 * TWIST[:3]).max() < 1e-12
        turned = pin.exp3(0.5 * TWIST[3:]) @ R
        assert np.abs(turned - samples[1000].orientation.rotation).max() < 1e-12


@pytest.mark.parametrize("axes", AXES)
def test_the_pose_is_the_integral_of_the_commanded_twist(axes: Any) -> None:
    rng = np.random.default_rng(5)
    stream = StreamPose(axes=axes, delay=0.05).anchored(START)
    run(
        stream,
        0.9,
        lambda k: k % 70 or stream.run.send(velocity=rng.normal(size=6) * [0.3] * 6),
    )
    assert_integral(stream, np.linspace(0.05, 0.88, 300))


def test_the_integral_is_exact_along_a_change_of_a_twist_in_the_tool_s_axes() -> None:
    """Δx = ∫ x' dt: Gauss's rule with 10 points is exact there."""
    stream = StreamPose(axes="tool", delay=0.4, dead_man=1.0).anchored(START)
    run(stream, 0.6, held(stream, 4.0 * TWIST, 50, 51))
    nodes, weights = np.polynomial.legendre.leggauss(10)
    for begin in (*np.arange(0.06, 0.42, 0.02), 0.46, 0.5):  # 0.45: it is reached
        times = begin + 0.01 * (nodes + 1.0)
        velocities = [stream.sample(t).position.velocity for t in times]
        moved = 0.01 * weights @ np.array(velocities)
        apart = stream.sample(begin + 0.02).position.position - (
            stream.sample(begin).position.position
        )
        assert np.abs(moved - apart).max() < 1e-13


@pytest.mark.parametrize("axes", AXES)
def test_a_stick_that_is_let_go_of_stops_the_hand(axes: Any) -> None:
    stream = StreamPose(axes=axes, dead_man=0.2, delay=0.1).anchored(START)
    samples = run(stream, 1.2, held(stream, TWIST, 100, 500))
    last = 100 + 380  # the sample at which the last message was taken
    assert np.abs(twist(samples[last + 199], axes) - TWIST).max() < 1e-12
    fading = twist(samples[last + 250], axes)
    assert 0.1 < np.linalg.norm(fading) / np.linalg.norm(TWIST) < 0.9
    # It stays on its line or screw until it is at rest.
    assert np.abs(fading / TWIST - fading[0] / TWIST[0]).max() < 5e-3
    for sample in samples[last + 301 :]:
        assert not twist(sample, axes).any()
        assert np.array_equal(pose(sample).np, pose(samples[-1]).np)


def test_a_stick_that_is_let_go_of_in_a_long_change_stops_the_hand_as_soon() -> None:
    """The change to 0.5 m/s takes 1.5 s here; the sender is silent from 0.1 s on."""
    stream = StreamPose(acceleration=0.5, dead_man=0.1).anchored(START)
    samples = run(stream, 2.0, held(stream, [0.5, 0, 0, 0, 0, 0], 0, 100))
    speed = np.array([each.position.velocity[0] for each in samples])
    assert speed.argmax() < 100 + 100 + 120  # it brakes during acceleration
    assert speed.max() < 0.1
    assert not speed[-1]
    held_on = StreamPose(acceleration=0.5, dead_man=0.1).anchored(START)
    samples = run(held_on, 2.0, held(held_on, [0.5, 0, 0, 0, 0, 0], 0, 2000))
    assert samples[1530].position.velocity[0] == pytest.approx(0.5, abs=1e-12)


def test_a_repeated_velocity_does_not_restart_the_motion() -> None:
    """The rate at which a velocity is repeated does not change the motion by a bit."""
    found = []
    for every in (5, 20, 90):
        stream = StreamPose(axes="tool").anchored(START)
        samples = run(stream, 0.5, held(stream, TWIST, 10, 450, every))
        found.append([pose(each).np.tobytes() for each in samples[:465]])
    assert found[0] == found[1] == found[2]


@pytest.mark.parametrize("axes", AXES)
def test_a_velocity_beyond_the_bounds_keeps_its_direction(axes: Any) -> None:
    stream = StreamPose(axes=axes, dead_man=3.0).anchored(START)
    stick = np.array([0.4, 0.0, -2.0, 0.0, 0.0, 7.0])
    samples = run(stream, 1.0, held(stream, stick, 10, 11))
    wanted = np.array([0.1, 0.0, -0.5, 0.0, 0.0, 0.95 * 2.5])
    assert np.abs(twist(samples[-1], axes) - wanted).max() < 1e-12
    joints = Stream(np.zeros(3), speed=[1.0, 2.0, 0.5], dead_man=3.0).anchored(None)
    last = run(joints, 2.0, held(joints, [1.0, 4.0, 0.1], 10, 11))[-1]
    assert np.allclose(last.velocity, [0.5, 2.0, 0.05], rtol=0, atol=1e-12)


@pytest.mark.parametrize("axes", AXES)
def test_a_stick_that_is_turned_back_amid_a_change_keeps_the_bounds(axes: Any) -> None:
    """No cubic does: during acceleration a constant velocity is reached first."""
    most = 0.0
    for late in range(10, 150, 10):
        stream = StreamPose(dead_man=9.0, delay=0.0, axes=axes).anchored(START)
        twists = {5: [0.5, 0.2, 0, 0, 0, 0.5], 5 + late: [-0.5, 0.5, 0.3, 0.5, 0, -0.5]}
        feed = lambda k, s=stream, w=twists: k in w and s.run.send(velocity=w[k])  # noqa: E731
        found = np.array([twist(each, axes) for each in run(stream, 0.6, feed)])
        most = max(most, np.abs(found[:, :3]).max())
        assert np.abs(found[-1] - twists[5 + late]).max() < 1e-12
    assert most <= stream.run.stream.speed + 1e-9


def test_a_spin_that_is_followed_by_a_target_keeps_its_bound() -> None:
    """A component of ω may reach √3 times Ruckig's bound, and returns into it."""
    rng = np.random.default_rng(1)
    for axis in np.eye(3):
        stream = StreamPose(dead_man=9.0, delay=0.02).anchored(START)
        goal = START * pin.exp6(np.concatenate([np.zeros(3), rng.normal(size=3)]))
        spin = np.concatenate([np.zeros(3), 3.0 * axis])

        def feed(k: int, s: Any = stream, w: Any = spin, to: Any = goal) -> None:
            if k == 5:
                s.run.send(velocity=w)
            elif k == 350:
                s.run.send(to)

        samples = run(stream, 3.0, feed)
        omega = [each.orientation.angular_velocity for each in samples]
        assert (
            2.3 < np.linalg.norm(omega, axis=1).max() <= stream.run.stream.angular_speed
        )
        away = goal.actInv(pose(samples[-1]))
        assert np.abs(away.np - np.eye(4)).max() < 1e-7


@settings(max_examples=25 if THOROUGH else 5)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.3))
def test_bounds_hold_in_the_axes_of_the_command(seed: int, delay: float) -> None:
    """Random velocities in tool axes at random times, with pauses."""
    rng = np.random.default_rng(seed)
    stream = StreamPose(axes="tool", delay=delay).anchored(START)

    def feed(k: int) -> None:
        if rng.random() < 0.03:
            stream.run.send(velocity=rng.normal(size=6) * 10.0 ** rng.uniform(-2, 1))

    samples = run(stream, 1.0, feed)
    rates = np.array([twist(each, "tool") for each in samples])
    assert np.abs(rates[:, :3]).max() <= stream.run.stream.speed + 1e-9
    linear = np.diff(rates[:, :3], axis=0) / H
    assert np.abs(linear).max() <= stream.run.stream.acceleration + 1e-9
    assert np.linalg.norm(rates[:, 3:], axis=1).max() <= stream.run.stream.angular_speed
    turning = [each.orientation.angular_acceleration for each in samples]
    most = np.linalg.norm(turning, axis=1).max()
    assert most <= stream.run.stream.angular_acceleration * (1.0 + 1e-6)
    assert_integral(stream, np.linspace(0.1, 0.98, 20))


@settings(max_examples=25 if THOROUGH else 5)
@given(st.integers(0, 2**32 - 1), st.floats(0.0, 0.3))
def test_targets_and_velocities_in_both_axes_follow_each_other(
    seed: int, delay: float
) -> None:
    """For any sequence of messages the pose is the integral of its velocity."""
    rng = np.random.default_rng(seed)
    stream = StreamPose(delay=delay, policy="extrapolate").anchored(START)

    def feed(k: int) -> None:
        if rng.random() > 0.02:
            return
        if rng.random() < 0.4:
            goal = START * pin.exp6(rng.normal(size=6) * 0.2)
            stream.run.send(goal)
        else:
            velocity = rng.normal(size=6) * 10.0 ** rng.uniform(-2, 1)
            stream.run.send(velocity=velocity, axes=rng.choice(AXES))

    samples = run(stream, 1.5, feed)
    assert_integral(stream, np.linspace(0.6, 1.48, 40))
    omega = [each.orientation.angular_velocity for each in samples]
    bounds = stream.run.stream
    assert np.linalg.norm(omega, axis=1).max() <= bounds.angular_speed * (1 + 1e-6)
    # In axes other than the command's a component is at most √3 larger.
    speed = [each.position.velocity for each in samples]
    assert np.linalg.norm(speed, axis=1).max() <= np.sqrt(3) * bounds.speed + 1e-9


def test_an_orientation_rotates_about_its_own_axes() -> None:
    stream = StreamOrientation(START.rotation, axes="tool").anchored(START.rotation)
    last = run(stream, 0.6, held(stream, TWIST[3:], 10, 600))[-1]
    assert np.abs(last.rotation.T @ last.angular_velocity - TWIST[3:]).max() < 1e-12


def test_a_message_may_name_other_axes_and_its_record_repeats_them() -> None:
    stream = StreamPose(dead_man=1.0).anchored(START)

    def feed(k: int) -> None:
        if k in (100, 400):
            stream.run.send(velocity=TWIST, axes="tool" if k == 100 else None)

    first = run(stream, 0.8, feed)
    assert np.abs(twist(first[399], "tool") - TWIST).max() < 1e-12
    assert np.abs(twist(first[-1], "world") - TWIST).max() < 1e-12
    messages = json.loads(json.dumps(stream.run.record))
    again = StreamPose(dead_man=1.0, messages=messages).anchored(START)
    for one, other in zip(first, run(again, 0.8), strict=True):
        assert np.array_equal(pose(one).np, pose(other).np)


@pytest.mark.parametrize(("kind", "message", "arguments"), [
    (StreamPose, "axes is 'hand'; needs 'world' or", {
        "velocity": TWIST, "axes": "hand"}),
    (StreamPose, "axes are only for a velocity without a value", {
        "value": [0, 0, 0, 0, 0, 0, 1], "velocity": TWIST, "axes": "tool"}),
])  # fmt: skip
def test_wrong_axes_are_refused(kind: Any, message: str, arguments: Any) -> None:
    with pytest.raises(StreamError, match=message):
        kind().anchored(START).run.send(**arguments)


def test_a_stream_of_points_has_no_tool() -> None:
    stream = Stream([0.0]).anchored(None)
    with pytest.raises(StreamError, match="a stream without an orientation has no"):
        stream.run.send(velocity=[0.1], axes="tool")
    with pytest.raises(TrajectoryError, match="axes: unknown argument 'axes'"):
        Stream([0.0], axes="tool")  # type: ignore[call-arg]
