"""Streamed references: exact derivatives, bounds, policies, and bad input."""

import copy
import json
import pickle
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import THOROUGH

from hsp_control.common.errors import StreamError, TrajectoryError
from hsp_control.trajectories import (
    Stream,
    StreamOrientation,
    StreamPose,
    TrajectorySample,
)
from hsp_control.trajectories.streams import inbox
from hsp_control.trajectories.streams.followed import (
    FollowedOrientation,
    FollowedPose,
)
from hsp_control.trajectories.streams.inbox import Inbox, Reader
from hsp_control.trajectories.streams.message import Message, Space
from hsp_control.trajectories.streams.planner import Planner, Room
from hsp_control.trajectories.streams.sources import read_recording

H = 5e-4
"""Time between samples [s]."""
POLICIES = ("latest", "interpolate", "extrapolate")


def sampled(
    stream: Any, duration: float, feed: Callable[[float], object] = lambda t: None
) -> list[Any]:
    """Return the samples of a run; ``feed`` sends the messages of every time."""
    samples = []
    for k in range(round(duration / H) + 1):
        feed(k * H)
        samples.append(stream.sample(k * H))
    return samples


def columns(samples: list[TrajectorySample]) -> tuple[np.ndarray, ...]:
    return tuple(np.array(each) for each in zip(*samples, strict=True))


def at_times(*events: tuple[float, Callable[[], object]]) -> Callable[[float], object]:
    """Return a feed that calls each function once, at its time [s]."""
    left = sorted(events, key=lambda event: event[0])

    def feed(t: float) -> None:
        while left and left[0][0] <= t + 1e-9:
            left.pop(0)[1]()

    return feed


def assert_derivatives(x: Any, rate: Any, acceleration: Any, jerk: float) -> None:
    """Check that x' and x'' are derivatives: their integrals are the differences.

    Trapezia with the next derivative at their ends are exact for cubics. Where the jerk
    jumps, by at most twice its bound, the error of x is at most that times h³/24.
    """
    integral = H * (rate[1:] + rate[:-1]) / 2
    integral -= H * H * np.diff(acceleration, axis=0) / 12
    assert np.abs(np.diff(x, axis=0) - integral).max() < jerk * H**3 / 12 + 1e-12
    trapezia = H * (acceleration[1:] + acceleration[:-1]) / 2
    assert np.abs(np.diff(rate, axis=0) - trapezia).max() < jerk * H * H / 4 + 1e-11


def hostile(rng: np.random.Generator, stream: Any, n: int) -> Callable[[float], None]:
    """Return a feed of random messages of all kinds, in bursts and out of order."""
    rotational = 4 if isinstance(stream, FollowedPose | FollowedOrientation) else 0

    def value() -> np.ndarray:
        point = rng.normal(size=n) * 10.0 ** rng.uniform(-3, 1)
        turn = rng.normal(size=rotational)
        return np.concatenate([point, turn / (np.linalg.norm(turn) or 1.0)])

    def rates() -> np.ndarray:
        size = n + 3 * bool(rotational)
        return rng.normal(size=size) * 10.0 ** rng.uniform(-2, 1)

    def feed(t: float) -> None:
        if rng.random() > 0.02:
            return
        for _ in range(rng.integers(1, 4)):
            stamp = None if rng.random() < 0.4 else t + rng.normal() * 0.05
            kind = rng.integers(4)
            if kind == 0:
                stream.run.send(velocity=rates(), t=stamp)
            elif kind == 1:
                stream.run.send(value(), velocity=rates(), t=stamp)
            elif kind == 2:
                stream.run.send(value(), t=stamp)
            else:
                times = np.cumsum(rng.uniform(1e-3, 0.1, rng.integers(1, 20)))
                stream.run.send_chunk([value() for _ in times], times, t=stamp)

    return feed


@settings(max_examples=25 if THOROUGH else 5)
@given(st.integers(0, 2**32 - 1), st.sampled_from(POLICIES), st.floats(0.0, 0.3))
def test_points_keep_their_bounds_for_any_messages(
    seed: int, policy: Any, delay: float
) -> None:
    rng = np.random.default_rng(seed)
    stream = Stream(
        [0.2, -0.1], policy=policy, delay=delay, smoothing=rng.choice([0.0, 0.1]),
        speed=[0.7, 0.3], acceleration=[3.0, 5.0], jerk=[80.0, 40.0],
        hold_after=0.3,
    ).anchored(None)  # fmt: skip
    x, rate, acceleration = columns(sampled(stream, 1.5, hostile(rng, stream, 2)))
    assert (np.abs(rate) <= np.array([0.7, 0.3]) + 1e-9).all()
    assert (np.abs(acceleration) <= np.array([3.0, 5.0]) + 1e-9).all()
    jerk = np.abs(np.diff(acceleration, axis=0)) / H
    assert (jerk <= np.array([80.0, 40.0]) + 1e-6).all()
    assert_derivatives(x, rate, acceleration, 80.0)


@settings(max_examples=25 if THOROUGH else 5)
@given(st.integers(0, 2**32 - 1), st.sampled_from(POLICIES), st.floats(0.0, 0.3))
def test_poses_keep_their_bounds_for_any_messages(
    seed: int, policy: Any, delay: float
) -> None:
    rng = np.random.default_rng(seed)
    stream = StreamPose(policy=policy, delay=delay).anchored(pin.SE3.Random())
    samples = sampled(stream, 1.0, hostile(rng, stream, 3))
    x, rate, acceleration = columns([each.position for each in samples])
    R, omega, omega_dot = columns([each.orientation for each in samples])
    assert_derivatives(x, rate, acceleration, stream.run.stream.jerk)
    assert np.abs(rate).max() <= stream.run.stream.speed + 1e-9
    assert np.abs(acceleration).max() <= stream.run.stream.acceleration + 1e-9
    for value, bound in (
        (omega, stream.run.stream.angular_speed),
        (omega_dot, stream.run.stream.angular_acceleration),
        (np.diff(omega_dot, axis=0) / H, stream.run.stream.angular_jerk),
    ):
        assert np.linalg.norm(value, axis=1).max() <= bound * (1.0 + 1e-6)
    for k in range(len(R) - 1):
        turned = pin.log3(R[k + 1] @ R[k].T)
        mean = (omega[k] + omega[k + 1]) / 2  # the commutator is of third order
        assert np.abs(turned - H * mean).max() < stream.run.stream.angular_jerk * H**3
        assert np.abs(R[k] @ R[k].T - np.eye(3)).max() < 1e-12
    trapezia = H * (omega_dot[1:] + omega_dot[:-1]) / 2
    error = np.abs(np.diff(omega, axis=0) - trapezia).max()
    assert error < stream.run.stream.angular_jerk * H * H / 4 + 1e-11


# -- policies -------------------------------------------------------------------------


def circle(t: float) -> np.ndarray:
    return np.array([0.1 * np.cos(2 * t) - 0.1, 0.1 * np.sin(2 * t)])


@pytest.mark.parametrize("policy", ["interpolate", "extrapolate"])
def test_the_reference_passes_waypoints_at_their_time(policy: Any) -> None:
    stream = Stream([0.0, 0.0], policy=policy, delay=0.15).anchored(None)
    times = np.arange(0.05, 2.0, 0.05)
    feed = at_times(*((t, lambda t=t: stream.run.send(circle(t), t=t)) for t in times))
    x, _, acceleration = columns(sampled(stream, 2.0, feed))
    for t in times[10:-6]:  # after it has caught up
        k = round((t + 0.15) / H)
        # A message is read at the first sample after its arrival: the clocks' offset.
        assert np.abs(x[k] - circle(t)).max() < 3 * H * 0.2
    assert np.abs(acceleration[1000:3500]).max() < 0.6  # a circle's is 0.4


def test_lost_and_jittered_waypoints_in_any_order_change_little() -> None:
    rng = np.random.default_rng(1)
    stream = Stream([0.0, 0.0], policy="interpolate", delay=0.2).anchored(None)
    events = []
    for t in np.arange(0.05, 2.0, 0.05):
        if rng.random() > 0.05:
            late = t + rng.uniform(0.0, 0.07)  # sometimes after the next one
            events.append((late, lambda t=t: stream.run.send(circle(t), t=t)))
    x, _, _ = columns(sampled(stream, 2.0, at_times(*events)))
    t = H * np.arange(len(x))
    wanted = np.array([circle(s - 0.2) for s in t])
    assert np.abs(x - wanted)[1500:3900].max() < 4e-3


@pytest.mark.parametrize(
    ("policy", "goals"),
    [("latest", [0.5, 0.2]), ("interpolate", [0.2]), ("extrapolate", [0.2])],
)
def test_the_newest_target_is_reached_at_rest(policy: Any, goals: list[float]) -> None:
    stream = Stream([0.0], policy=policy).anchored(None)
    feed = at_times(
        *(
            (0.1 + 0.2 * k, lambda x=x: stream.run.send([x]))
            for k, x in enumerate(goals)
        )
    )
    x, rate, acceleration = columns(sampled(stream, 2.0, feed))
    assert x[-1, 0] == pytest.approx(0.2, abs=1e-9)
    assert not rate[-1].any()
    assert not acceleration[-1].any()


def test_extrapolation_ends_and_the_reference_holds() -> None:
    stream = Stream([0.0], policy="extrapolate", delay=0.1, extrapolation=0.2).anchored(
        None
    )
    feed = at_times(
        *(
            (t, lambda t=t: stream.run.send([0.2 * t], t=t))
            for t in np.arange(0, 1, 0.05)
        )
    )
    x, rate, _ = columns(sampled(stream, 2.0, feed))
    last = 0.95 + 0.1
    going = round((last + 0.19) / H)
    assert rate[going, 0] == pytest.approx(0.2, abs=1e-6)
    assert not rate[round(1.6 / H) :].any()
    assert x[-1, 0] > 0.2 * 0.95 + 0.2 * 0.2


def test_a_twist_turns_the_hand_about_a_fixed_axis_until_it_is_silent() -> None:
    start = pin.SE3(pin.exp3(np.array([0.3, -0.5, 0.9])), np.array([0.4, 0.0, 0.5]))
    stream = StreamPose(delay=0.05, extrapolation=0.1).anchored(start)
    twist = np.array([0.1, 0.0, -0.05, 0.0, 0.6, 0.3])
    feed = at_times(
        *((t, lambda: stream.run.send(velocity=twist)) for t in np.arange(0.1, 1, 0.02))
    )
    samples = sampled(stream, 1.5, feed)
    moving, still = samples[round(0.8 / H)], samples[-1]
    assert np.allclose(moving.position.velocity, twist[:3], atol=1e-9)
    # A change of velocity reaches ω to second order; the next message completes it.
    assert np.allclose(moving.orientation.angular_velocity, twist[3:], atol=1e-5)
    assert not still.position.velocity.any()
    assert not still.orientation.angular_velocity.any()


def test_a_chunk_replaces_the_rest_of_the_one_before() -> None:
    stream = Stream([0.0], policy="interpolate", delay=0.05).anchored(None)
    times = np.arange(1, 17) * 0.02
    feed = at_times(
        (0.1, lambda: stream.run.send_chunk((0.2 * times)[:, None], times, t=0.1)),
        (0.2, lambda: stream.run.send_chunk((-0.1 * times)[:, None], times, t=0.2)),
        # An old chunk that arrives late is ignored.
        (0.25, lambda: stream.run.send_chunk((9.0 + times)[:, None], times, t=0.15)),
    )
    x, _, _ = columns(sampled(stream, 1.0, feed))
    assert x.max() < 0.05
    assert x[-1, 0] == pytest.approx(-0.1 * times[-1], abs=1e-9)
    assert stream.run.counts()["late"] == 1


# -- time, silence, runs --------------------------------------------------------------


def test_silence_holds_and_then_stops_with_the_time() -> None:
    stream = Stream([0.0], hold_after=0.2, stop_after=0.6).anchored(None)
    feed = at_times((0.1, lambda: stream.run.send([50.0])))
    x, rate, _ = columns(sampled(stream, 0.65, feed))
    assert rate.max() > 0.5
    assert not rate[-1].any()
    assert x[-1, 0] < 1.0
    with pytest.raises(
        StreamError, match=r"no message for 0\.6.* s; stop_after is 0\.6"
    ):
        stream.sample(0.75)


def test_the_sender_s_clock_is_found_and_may_start_again() -> None:
    """Waypoints are passed at their times plus the delay."""
    bounds = {"speed": 1e3, "acceleration": 1e4, "jerk": 1e6}
    stream = Stream([0.0], delay=2.0, **bounds).anchored(None)
    # The fastest message takes 0.01 s; the first arrives before that is known.
    for k, late in enumerate([0.03, 0.01, 0.02, 0.04]):
        stream.sample(0.05 * k + late - H)
        stream.run.send([float(k)], t=100.0 + 0.05 * k)
        stream.sample(0.05 * k + late)
    for k in (1, 2, 3):
        stream.sample(t := 2.01 + 0.05 * k)
        assert stream.sample(t).position[0] == pytest.approx(k, abs=1e-9)
    stream.run.send([7.0], t=5.0)
    stream.sample(3.0)
    assert stream.sample(5.0).position[0] == pytest.approx(7.0, abs=1e-9)
    assert stream.sample(4.99).position[0] != pytest.approx(7.0, abs=1e-9)


@pytest.mark.parametrize("policy", POLICIES)
def test_room_is_made_for_all_waypoints(policy: str) -> None:
    """Memory grows for large chunks and many messages; the reference has enough of
    it."""
    rng = np.random.default_rng(59)
    streams = [Stream([0.0, 0.0], policy=policy, delay=1.0).anchored(None)]
    streams.append(copy.deepcopy(streams[0]))
    large = Room(messages=2000, waypoints=4000)
    run = streams[1].run
    given = run.chart, run.stream.bounds(), run.stream.how, run.stream.begin()
    run._planner = Planner(*given, large)
    for k in range(1500):
        if k % 300 == 100:
            rows, t = int(rng.integers(1, 400)), float(rng.uniform(0.0, 0.1))
            values = rng.normal(0.0, 0.1, (rows, 2))
            for each in streams:
                each.run.send_chunk(values, 0.01 * (1 + np.arange(rows)), t=t)
        elif k > 700:
            value = rng.normal(0.0, 0.1, 2)
            for each in streams:
                each.run.send(value)
        one, other = (each.sample(k * 1e-3) for each in streams)
        np.testing.assert_array_equal(one, other)
    assert streams[0].run.counts() == streams[1].run.counts()


def test_earlier_times_are_known_while_a_step_begins_many_pieces() -> None:
    """If a step has more pieces than it can store, the last are kept, others
    reported."""
    stream = Stream([0.0]).anchored(None)
    stream.sample(0.0)
    times = 0.02 * (1 + np.arange(25))
    stream.run.send_chunk(1e-3 * np.sin(times)[:, None], times)
    stream.sample(0.01)
    fine = copy.deepcopy(stream)
    before = [fine.sample(t) for t in np.arange(0.02, 0.6, 0.01)]
    stream.sample(0.6)
    known = 0
    for t, expected in zip(np.arange(0.02, 0.6, 0.01), before, strict=True):
        try:
            found = stream.sample(t)
        except StreamError as error:
            assert "is not known any more" in str(error)  # noqa: PT017
            assert not known
        else:
            known += 1
            np.testing.assert_allclose(found, expected, rtol=0.0, atol=1e-12)
    assert 10 < known < 50


def test_an_exception_in_a_rehearsal_leaves_nothing() -> None:
    stream = Stream([0.0]).anchored(None)
    stream.sample(0.0)
    stream.run.send([0.1])
    stream.sample(0.1)
    before = pickle.dumps(stream.run)
    fits, does_not = (Message.of(None, np.ones((1, n)), None) for n in (1, 3))
    with pytest.raises(ValueError, match="broadcast"):
        stream.run._planned.rehearse([fits, does_not])
    assert pickle.dumps(stream.run) == before


def test_a_new_run_begins_anew_and_reads_new_messages_only() -> None:
    stream = Stream([0.0])
    first = stream.anchored(None)
    feed = at_times((0.1, lambda: first.run.send([0.1])))
    x, _, _ = columns(sampled(first, 1.0, feed))
    assert x[-1, 0] == pytest.approx(0.1)
    assert [entry["at"] for entry in first.run.record] == [pytest.approx(0.1)]
    second = stream.anchored(None)
    second.run.follow(first.run)
    x, _, _ = columns(sampled(second, 1.0))
    assert not x.any()
    assert not second.run.record
    first.run.send([0.2])  # not read yet
    third = stream.anchored(None)
    third.run.follow(second.run)
    x, _, _ = columns(sampled(third, 1.0))
    assert x[-1, 0] == pytest.approx(0.2)


def test_recorded_messages_give_the_same_bits() -> None:
    rng = np.random.default_rng(3)
    stream = StreamPose(policy="extrapolate").anchored(pin.SE3.Identity())
    first = sampled(stream, 1.0, hostile(rng, stream, 3))
    messages = json.loads(json.dumps(stream.run.record))
    again = StreamPose(policy="extrapolate", messages=messages)
    again = again.anchored(pin.SE3.Identity())
    second = sampled(again, 1.0)
    for one, other in zip(first, second, strict=True):
        assert np.array_equal(one.position, other.position)
        assert all(map(np.array_equal, one.orientation, other.orientation))
    assert json.loads(json.dumps(again.run.record)) == messages


def test_a_full_record_reports_its_losses(monkeypatch: Any) -> None:
    monkeypatch.setattr(inbox, "MOST", 7)  # a value and its time each
    stream = Stream([0.0]).anchored(None)
    feed = at_times(*((0.1, lambda: stream.run.send([0.1])) for _ in range(5)))
    sampled(stream, 0.2, feed)
    assert (len(stream.run.record), stream.run.unrecorded) == (3, 2)
    assert stream.run.counts()["taken"] == 5


def test_little_is_recorded_without_a_log(monkeypatch: Any) -> None:
    monkeypatch.setattr(inbox, "BRIEF", 7)
    for logged, kept in ((False, 3), (True, 5)):
        stream = Stream([0.0]).anchored(None)
        if logged:
            stream.run.log()
        feed = at_times(*((0.1, lambda s=stream: s.run.send([0.1])) for _ in range(5)))
        sampled(stream, 0.2, feed)
        assert (len(stream.run.record), stream.run.unrecorded) == (kept, 5 - kept)


def test_a_target_that_no_motion_reaches_is_refused_and_the_reference_rests() -> None:
    stream = Stream([0.0] * 3, speed=0.01).anchored(None)
    feed = at_times(
        (0.1, lambda: stream.run.send([0.1, 0.0, 0.0])),
        (0.5, lambda: stream.run.send([9e5, 1.0, 1.0])),
        (1.5, lambda: stream.run.send([0.0, 0.0, 0.001])),
    )
    x, rate, _ = columns(sampled(stream, 3.0, feed))
    assert stream.run.counts()["rejected"] == 1
    assert not rate[round(1.4 / H)].any()
    assert x[-1] == pytest.approx([0.0, 0.0, 0.001])


def test_a_time_that_is_forgotten_is_an_error_and_not_an_extrapolation() -> None:
    stream = Stream([0.0]).anchored(None)
    feed = at_times(
        *((0.05 * k, lambda k=k: stream.run.send([0.1 * k])) for k in range(60))
    )
    sampled(stream, 3.0, feed)
    with pytest.raises(StreamError, match=r"at t = 0 s is not known any more: the run"):
        stream.sample(0.0)


def test_a_copy_changes_nothing_for_the_original() -> None:
    def run(preview: bool) -> np.ndarray:
        stream = Stream([0.0], policy="interpolate", delay=0.2).anchored(None)

        def feed(t: float) -> None:
            k = round(t / H)
            if k % 100 == 0:
                late = 0.0 if k == 2000 else 0.08
                stream.run.send([np.sin(t - late)], t=t - late + 100.0)
            if preview and k == 2100:
                copy.deepcopy(stream).sample(4.0)

        return columns(sampled(stream, 2.0, feed))[0]

    assert np.array_equal(run(False), run(True))


def state_of(stream: Any, t: float) -> bytes:
    return b"".join(each.tobytes() for each in stream.sample(t))


def test_a_pickle_brakes_where_its_original_does() -> None:
    """Without messages, a motion to a moving goal ends before Ruckig's does."""
    stream = Stream([0.0], policy="extrapolate", jerk=2.0, speed=5.0).anchored(None)
    feed = at_times(
        *(
            (0.05 * k, lambda k=k: stream.run.send([0.02 * k], t=0.05 * k))
            for k in range(9)
        )
    )
    sampled(stream, 0.41, feed)
    again = pickle.loads(pickle.dumps(stream))
    for t in np.arange(0.41, 3.0, 0.05):
        assert state_of(again, t) == state_of(stream, t)


def test_a_pickle_has_waiting_messages_and_no_read_ones() -> None:
    stream = Stream([0.0]).anchored(None)
    sampled(stream, 0.1, at_times((0.05, lambda: stream.run.send([0.1]))))
    stream.run.send([0.2])
    again, copied = pickle.loads(pickle.dumps(stream)), copy.deepcopy(stream)
    for t in np.arange(0.11, 1.0, 0.01):
        stream.sample(t)
    # The original has read it already; this copy has not.
    behind = pickle.loads(pickle.dumps(copied))
    for each in (again, behind):
        each.sample(0.2)
        assert each.sample(1.0).position[0] == pytest.approx(0.2, abs=1e-9)
    assert [each.run.counts()["taken"] for each in (stream, again, behind)] == [2, 2, 2]


def test_a_recording_goes_on_in_a_pickle() -> None:
    messages = [{"at": 0.1 * k, "value": [0.01 * k]} for k in range(1, 9)]
    stream = Stream([0.0], messages=messages).anchored(None)
    sampled(stream, 0.45)
    again = pickle.loads(pickle.dumps(stream))
    for t in np.arange(0.46, 1.5, 0.02):
        assert state_of(again, t) == state_of(stream, t)
    assert again.run.counts() == stream.run.counts()


# -- bad input ------------------------------------------------------------------------

IDENTITY = [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(("arguments", "message"), [
    ({"value": [0.0, np.nan, 0.0, *IDENTITY]}, "value contains nan; needs finite"),
    ({"value": [1e7, 0.0, 0.0, *IDENTITY]}, "value contains 1e\\+07; needs finite"),
    ({"value": [0.0, 0.0, 0.0]}, "value has 3 numbers; this stream needs 7: x, y"),
    ({"value": [0.0] * 7}, "the quaternion .* has norm 0; needs 1"),
    ({"value": [0, 0, 0, 0, 0, 0, 1.1]}, "has norm 1.1; needs 1"),
    ({"value": "here"}, "value is 'here'; needs a list of numbers"),
    ({"velocity": [0.0] * 5}, "velocity has 5 numbers; this stream needs 6"),
    ({}, "a message needs a value, values or one velocity"),
    ({"value": [0.0] * 6 + [1.0], "t": np.inf}, "clock, is inf; needs a number of"),
])  # fmt: skip
def test_a_wrong_target_is_refused_where_it_is_sent(
    arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises(StreamError, match=message):
        StreamPose().anchored(pin.SE3.Identity()).run.send(**arguments)


@pytest.mark.parametrize(("values", "times", "message"), [
    ([[0.0], [1.0]], [0.1, 0.1], r"times\[1\] = 0.1 is not later than times\[0\]"),
    ([[0.0], [1.0]], [0.1], "there are 1 times for 2 values"),
    ([[0.0]] * 1001, np.arange(1001), "values has 1001 rows; needs 1 to 1000"),
    ([0.0], [0.1], r"values has shape \(1,\); needs a list of lists"),
])  # fmt: skip
def test_a_wrong_chunk_is_refused(values: Any, times: Any, message: str) -> None:
    with pytest.raises(StreamError, match=message):
        Stream([0.0]).anchored(None).run.send_chunk(values, times)


def test_a_stream_of_two_sizes_is_refused() -> None:
    """One declaration that two tasks follow has one queue."""
    stream = Stream()
    one, other = stream.anchored([0.0, 0.0, 0.0]), stream.anchored([0.0])
    with pytest.raises(StreamError, match="value has 2 numbers; this stream needs 3"):
        one.run.send([0.1, 0.2])
    with pytest.raises(StreamError, match="already carries 3 numbers; here 1 are"):
        other.run.follow(one.run)


@pytest.mark.parametrize(("arguments", "message"), [
    ({"source": "tcp://a:5005"}, "source is 'tcp://a:5005'.* An address begins"),
    ({"source": "a.jsonl", "messages": []}, "give either source or messages"),
    ({"messages": [{"value": [0.0]}]}, "message 0 of the recording: it needs the"),
    ({"messages": [{"at": 1.0, "valeu": [0.0]}]}, "has the key 'valeu'; known are"),
    ({"speed": -1.0}, "speed"),
    ({"policy": "newest"}, "policy"),
])  # fmt: skip
def test_a_wrong_declaration_is_refused(
    arguments: dict[str, Any], message: str
) -> None:
    with pytest.raises((StreamError, TrajectoryError), match=message):
        Stream(**arguments)


def test_bounds_that_contradict_each_other_are_refused() -> None:
    with pytest.raises(TrajectoryError, match="angular_acceleration is 5; with"):
        StreamOrientation(angular_speed=4.0, angular_acceleration=5.0)
    with pytest.raises(TrajectoryError, match="angular_jerk is 10; with these bounds"):
        StreamPose(angular_jerk=10.0)
    with pytest.raises(TrajectoryError, match="speed has 2 numbers; the stream needs"):
        Stream([0.0] * 3, speed=[1.0, 2.0]).anchored(None).sample(0.0)
    with pytest.raises(TrajectoryError, match="origin: start"):
        Stream(origin="start").anchored([0.0])


@pytest.mark.parametrize("kind", [Stream, StreamOrientation, StreamPose])
def test_a_declaration_moves_nothing_and_names_the_run(kind: Any) -> None:
    message = f"this {kind.__name__} is declared, .* controller.stream\\('hand'\\)"
    with pytest.raises(StreamError, match=message):
        kind().sample(0.0)
    with pytest.raises(StreamError, match=message):
        kind().begin()
    assert kind() == kind()
    assert hash(kind()) == hash(kind())


def test_a_stream_with_a_source_cannot_be_sent_to(tmp_path: Path) -> None:
    file = tmp_path / "goals.jsonl"
    file.write_text('{"at": 0, "value": [0]}\n')
    for source in (str(file), "udp://127.0.0.1:5005"):
        with pytest.raises(StreamError, match=f"receives from {re.escape(source)}"):
            Stream([0.0], source=source).anchored(None).run.send([0.0])


@pytest.mark.parametrize(("text", "message"), [
    ('{"at": 0, "value": [0]}\n{"at": NaN}', ":2: not JSON: NaN is no number"),
    ("{", ":1: not JSON"),
])  # fmt: skip
def test_a_wrong_recording_names_its_line(
    tmp_path: Any, text: str, message: str
) -> None:
    file = tmp_path / "goals.jsonl"
    file.write_text(text)
    with pytest.raises(StreamError, match=message):
        read_recording(file)
    with pytest.raises(StreamError, match="cannot be read"):
        read_recording(tmp_path / "none.jsonl")


# --- local coordinates ---------------------------------------------------------------


def test_a_spin_goes_on_beyond_half_a_turn() -> None:
    """Waypoints of a spin are one line, whatever the signs of their quaternions."""
    axis, base = np.array([2.0, -1.0, 2.0]) / 3.0, pin.exp3(np.array([0.3, 1.0, -0.2]))
    angles = 2.4 * np.arange(1, 8)
    turns = [pin.Quaternion(base @ pin.exp3(a * axis)).coeffs() for a in angles]
    values = np.hstack([np.zeros((7, 3)), turns])
    bounds = {"angular_speed": 6.0, "angular_acceleration": 50.0, "angular_jerk": 500.0}
    stream = StreamPose(policy="interpolate", delay=0.0, **bounds)
    stream = stream.anchored(pin.SE3(base, np.zeros(3)))
    feed = at_times((0.1, lambda: stream.run.send_chunk(values, np.arange(1.0, 8.0))))
    samples = sampled(stream, 7.0, feed)
    for k in range(6):
        R, omega, _ = samples[round((1.1 + k) / H)].orientation
        np.testing.assert_allclose(R, base @ pin.exp3(angles[k] * axis), atol=1e-3)
        np.testing.assert_allclose(omega, base @ axis * 2.4, atol=1e-2)


def test_a_copy_of_a_pickle_has_the_messages_that_wait_for_it_alone() -> None:
    inbox = Inbox(Space(1, False))
    first, behind = Reader(inbox), Reader(inbox, aside=True)
    inbox.put(value=[1.0])
    assert len(first.take(0.0)) == 1
    again = pickle.loads(pickle.dumps(behind))
    for reader in (again.copy(), again):
        assert len(reader.take(0.0)) == 1
        assert len(reader.take(0.0)) == 0
