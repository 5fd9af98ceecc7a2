"""The bytes are ROS 2's: an independent decoder, and CDR written by hand, agree."""

import struct
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

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
    ros_name,
)

STORES = [Stores.ROS2_HUMBLE, Stores.ROS2_JAZZY]
HEADER = Header(Time.of(1_700_000_000_123_456_789), "panda_link0")
EXAMPLES = [
    JointState(HEADER, ["a", "elbow"], [0.1, -2.0], [3.0, np.inf], [1e-9, -0.0]),
    JointState(HEADER, [], [], [], []),
    Float64MultiArray(MultiArrayLayout(), [1.5, -2.5, 3.5]),
    Float64MultiArray(MultiArrayLayout([MultiArrayDimension("x", 2, 3)], 1), [1.0]),
    PoseStamped(HEADER, Pose(Point(1.0, 2.0, 3.0), Quaternion(0.0, 0.6, 0.0, 0.8))),
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


def test_a_state_is_plain_little_endian_cdr() -> None:
    message = JointState(Header(Time(7, 8), "base"), ["j"], [0.5], [], [-1.0])
    body = struct.pack("<iI", 7, 8)
    body += struct.pack("<I5s", 5, b"base\0") + b"\0" * 3  # to a multiple of 4
    body += struct.pack("<II2s", 1, 2, b"j\0") + b"\0\0"
    body += struct.pack("<I", 1) + b"\0" * 4 + struct.pack("<d", 0.5)  # of 8
    body += struct.pack("<I", 0)
    body += struct.pack("<I", 1) + struct.pack("<d", -1.0)
    assert message.serialize() == b"\x00\x01\x00\x00" + body


def test_the_hashes_are_those_of_ros() -> None:
    types = get_typestore(Stores.ROS2_JAZZY)
    for kind, digest in TYPE_HASHES.items():
        name = ros_name(kind.__idl_typename__)
        assert types.hash_rihs01(name) == f"RIHS01_{digest}"
