"""The bytes are ROS 2's, by an independent decoder; names of a node."""

from typing import Any

import numpy as np
import pytest
from cyclonedds._clayer import ddspy_write
from ros2_rigs import DOMAIN, fresh, joint_state
from rosbags.typesys import Stores, get_typestore

from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2.messages import (
    TYPE_HASHES,
    Float64MultiArray,
    Header,
    JointState,
    MultiArrayDimension,
    MultiArrayLayout,
    Point,
    Pose,
    PoseStamped,
    Quaternion,
    Time,
    Twist,
    TwistStamped,
    Vector3,
    ros_name,
)
from hsp_control.companions.ros2.node import Node

STORES = [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY]
HEADER = Header(Time.of(1_700_000_000_123_456_789), "panda_link0")
EXAMPLES = [
    JointState(HEADER, ["a", "elbow"], [0.1, -2.0], [3.0, np.inf], [1e-9, -0.0]),
    JointState(HEADER, [], [], [], []),
    Float64MultiArray(MultiArrayLayout(), [1.5, -2.5, 3.5]),
    Float64MultiArray(MultiArrayLayout([MultiArrayDimension("x", 2, 3)], 1), [1.0]),
    PoseStamped(HEADER, Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.6, 0.0, 0.8))),
    TwistStamped(HEADER, Twist(Vector3(0.1, 0.2, 0.3), Vector3(-1.0, 0.0, 2.0))),
]


def name_of(message: object) -> str:
    return ros_name(type(message).__idl_typename__)  # type: ignore[attr-defined]


def same(ours: Any, theirs: Any) -> bool:
    if isinstance(ours, list):
        return len(ours) == len(theirs) and all(map(same, ours, theirs))
    if hasattr(ours, "__dataclass_fields__"):
        fields = ours.__dataclass_fields__
        assert set(fields) == set(theirs.__dataclass_fields__) - {"__msgtype__"}
        return all(same(getattr(ours, f), getattr(theirs, f)) for f in fields)
    return bool(ours == theirs)


@pytest.mark.parametrize("store", STORES)
@pytest.mark.parametrize("message", EXAMPLES, ids=name_of)
def test_ros_reads_our_bytes_and_writes_the_same(message: Any, store: Stores) -> None:
    types, name = get_typestore(store), name_of(message)
    theirs = types.deserialize_cdr(message.serialize(), name)
    assert same(message, theirs)
    assert bytes(types.serialize_cdr(theirs, name)) == message.serialize()
    assert (
        type(message).deserialize(bytes(types.serialize_cdr(theirs, name))) == message
    )


def test_the_hashes_are_those_of_ros() -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    for kind, digest in TYPE_HASHES.items():
        name = ros_name(kind.__idl_typename__)
        assert types.hash_rihs01(name) == f"RIHS01_{digest}"


LONG = 60.0


def test_ends_of_a_topic_see_each_other() -> None:
    topic, _, _ = fresh()
    node = Node(DOMAIN)
    publisher = node.publisher(topic, JointState)
    assert publisher.why_none().startswith(f"no subscriber of {topic} in domain ")
    subscription = Node(DOMAIN).subscription(topic, JointState)
    assert publisher.matched == subscription.matched == 1
    wrong = node.subscription(topic, Float64MultiArray)
    assert wrong.matched == 0
    assert wrong.why_none() == (
        f"{topic} has type sensor_msgs/msg/JointState; needs "
        "std_msgs/msg/Float64MultiArray"
    )
    del publisher
    assert subscription.matched == 0
    assert subscription.take() == []  # a departure is no message


def test_bytes_that_are_no_message_are_dropped() -> None:
    topic, _, _ = fresh()
    publisher = Node(DOMAIN).publisher(topic, JointState)
    subscription = Node(DOMAIN).subscription(topic, JointState)
    whole = joint_state(1).serialize()
    writer = publisher._writer._ref
    for cut in (0, 3, 8, len(whole) - 8):
        assert ddspy_write(writer, whole[:cut]) < 0
    assert ddspy_write(writer, whole[:12] + b"\xff" * 4 + whole[16:]) < 0
    assert ddspy_write(writer, whole.replace(b"joint3", b"joint\xff")) == 0
    publisher.send(joint_state(2))
    assert subscription.wait(LONG)
    (received,) = subscription.take()
    assert received.message == joint_state(2)
    assert subscription.malformed == 1


def test_a_configuration_of_cyclone_that_is_none_is_told(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("CYCLONEDDS_URI", "<CycloneDDS><Nonsense/></CycloneDDS>")
    unused = (DOMAIN + 17) % 233  # a domain is configured once per process
    with pytest.raises(HardwareError, match=f"cannot join the DDS domain {unused}: "):
        Node(unused)
