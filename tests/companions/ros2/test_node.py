"""Topics: who is there, and bytes that are no message."""

import pytest
from cyclonedds._clayer import ddspy_write
from ros2_rigs import DOMAIN, fresh, joint_state

from hsp_control.common.exceptions import HardwareError
from hsp_control.companions.ros2.messages import Float64MultiArray, JointState
from hsp_control.companions.ros2.node import Node

LONG = 60.0


def test_ends_of_a_topic_see_each_other() -> None:
    topic, _, _ = fresh()
    node = Node(DOMAIN)
    publisher = node.publisher(topic, JointState)
    assert publisher.why_none().startswith(f"nobody listens to {topic} in domain ")
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
    assert subscription.take() == []  # that one left is no message


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
    unused = (DOMAIN + 17) % 233  # a domain is configured once in a process
    with pytest.raises(HardwareError, match=f"cannot join the DDS domain {unused}: "):
        Node(unused)
