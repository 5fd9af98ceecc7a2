"""ROS 2 poses as targets: the part of a pose that a stream uses, and refusals."""

import re
from collections.abc import Callable
from time import monotonic
from typing import Any
from weakref import ref

import numpy as np
import pytest
from ros2_rigs import DOMAIN, fresh
from wording import wording

from hsp_control import Stream, StreamPose
from hsp_control.common.errors import StreamError
from hsp_control.companions.ros2 import targets
from hsp_control.companions.ros2.messages import (
    Header,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
    Twist,
    TwistStamped,
    Vector3,
)
from hsp_control.companions.ros2.node import Node, TopicPublisher
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import ORIENTATION, POSE, Space
from hsp_control.trajectories.streams.sources import listening_inbox

POSITION = Space(3, False)
HALF = 0.5
LONG = 60.0


def pose(
    stamp: int = 7_500_000_000, frame: str = "world", x: float = 0.4, w: float = HALF
) -> PoseStamped:
    where = Pose(Point(x, 0.1, 0.5), Quaternion(HALF, HALF, HALF, w))
    return PoseStamped(Header(Time.of(stamp), frame), where)


def opened(
    space: Space, options: str = "", kind: Any = PoseStamped
) -> tuple[Inbox, TopicPublisher[Any]]:
    topic, _, _ = fresh()
    inbox = listening_inbox(f"ros2:/{topic}?domain={DOMAIN}{options}", space)
    publisher = Node(DOMAIN).publisher(topic, kind)
    assert publisher.matched == 1
    return inbox, publisher


def until(true: Callable[[], Any]) -> None:
    end = monotonic() + LONG
    while not true():
        assert monotonic() < end


@pytest.mark.parametrize(("space", "value"), [
    (POSE, [0.4, 0.1, 0.5, HALF, HALF, HALF, HALF]),
    (POSITION, [0.4, 0.1, 0.5]),
    (ORIENTATION, [HALF, HALF, HALF, HALF]),
])  # fmt: skip
def test_a_stream_uses_its_part_of_a_pose(space: Space, value: Any) -> None:
    inbox, publisher = opened(space)
    publisher.send(pose())
    until(lambda: inbox.count == 1)
    ((_, message),) = inbox.after(0, take=True)
    assert message.values is not None
    assert message.values.tolist() == [value]
    assert message.t == 7.5
    publisher.send(pose(stamp=0, frame=""))
    until(lambda: inbox.count == 2)
    assert inbox.after(1, take=True)[0].message.t is None
    other = Node(DOMAIN).publisher(publisher.topic, PoseStamped)
    until(lambda: publisher.send(pose()) or other.send(pose()) or inbox.rejected)
    assert re.search(r"r \d+ is ignored: publisher \d+ sent first", inbox.reason)


def test_the_silence_of_the_only_publisher_is_told_once(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Its reference rests meanwhile; by a clock of this test, [s]."""
    there = [Inbox(POSITION, "ros2://hand")]
    times = iter([0.0, 0.1, 1.9, 2.2, 9.0])
    queue = {0.0: [pose(0)], 0.1: [pose(0)]}
    now = 0.0

    class Subscription:
        def wait(self, timeout: float) -> bool:
            nonlocal now
            now = next(times, np.inf)
            if now == np.inf:
                there.clear()
            return now in queue

        def take(self) -> list[tuple[PoseStamped, int]]:
            return [(message, 7) for message in queue[now]]

    monkeypatch.setattr(targets, "monotonic", lambda: now)
    targets._listen(Subscription(), {}, POSITION, ref(there[0]))  # type: ignore[arg-type]
    (told,) = caplog.messages
    assert "publisher 7 has been silent for 2 s" in told


@pytest.mark.parametrize(("wrong", "reason"), [
    ({"frame": "camera"}, "... frame 'camera' ... 'world'"),
    ({"x": np.nan}, "value ... nan ... finite ... 1e+06"),
    ({"w": 0.0}, "... quaternion [0.5, 0.5, 0.5, 0.0] ... 0.866025 ... 1"),
])  # fmt: skip
def test_wrong_poses_are_counted_and_dropped(
    wrong: dict[str, Any], reason: str
) -> None:
    inbox, publisher = opened(POSE)
    publisher.send(pose(**wrong))
    until(lambda: inbox.rejected == 1)
    assert re.search(wording(reason), inbox.reason)
    publisher.send(pose())
    until(lambda: inbox.count == 1)


@pytest.mark.parametrize(("space", "velocity"), [
    (POSE, [0.1, 0.2, 0.3, -1.0, 0.0, 2.0]),
    (POSITION, [0.1, 0.2, 0.3]),
    (ORIENTATION, [-1.0, 0.0, 2.0]),
])  # fmt: skip
def test_a_stream_uses_its_part_of_a_twist(space: Space, velocity: Any) -> None:
    inbox, publisher = opened(space, "&type=twist&tool=hand", TwistStamped)
    twist = Twist(Vector3(0.1, 0.2, 0.3), Vector3(-1.0, 0.0, 2.0))
    named = [("", None), ("world", "world"), *[("hand", "tool")] * space.rotational]
    for k, (frame, axes) in enumerate(named):
        publisher.send(TwistStamped(Header(Time.of(7_500_000_000), frame), twist))
        until(lambda k=k: inbox.count == k + 1)
        ((_, message),) = inbox.after(k, take=True)
        assert message.velocities is not None
        assert message.velocities.tolist() == [velocity]
        assert (message.values, message.axes, message.t) == (None, axes, 7.5)
    publisher.send(TwistStamped(Header(Time.of(0), "camera"), twist))
    until(lambda: inbox.rejected == 1)
    assert inbox.reason == ("a twist is in frame 'camera'; needs 'world' or 'hand'")


@pytest.mark.parametrize(("make", "message"), [
    (lambda: StreamPose(source="ros2://a?type=twists"), "is 'twists'; needs pose or"),
    (lambda: StreamPose(source="ros2://a?tool=hand"), "a tool is only for type=twist"),
    (lambda: listening_inbox("ros2://a?type=twist", Space(7, False)), "carries twists"),
    (lambda: Stream(source="ros2://a b"), "'ros2://a b': 'a b' is not a ROS 2 name"),
    (lambda: StreamPose(source="ros2://a?frames=b"), "'frames'; did you mean 'fra"),
    (lambda: listening_inbox("ros2://a", Space(7, False)), "needs 7 numbers"),
    (lambda: StreamPose(source="ros2://a?domain=300"), "is '300'; needs 0 to 232"),
])  # fmt: skip
def test_mistakes_are_named(make: Callable[[], object], message: str) -> None:
    with pytest.raises(StreamError) as caught:
        make()
    assert message in str(caught.value)
