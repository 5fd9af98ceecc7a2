"""Published topics: the state, the effort and the poses of the tasks."""

import numpy as np
import pytest
from live_rigs import law, start
from loaded_robots import panda
from ros2_rigs import DOMAIN, fresh

from hsp_control import Controller, FramePose, FramePosition, Gains, Stream, StreamPose
from hsp_control.common.errors import HardwareError
from hsp_control.companions.ros2 import publish
from hsp_control.companions.ros2.messages import JointState, PoseStamped
from hsp_control.companions.ros2.node import Node, Subscription
from hsp_control.control.compensation import CompensatedController

REST = np.zeros(7)


def received(topic: str) -> Subscription[PoseStamped]:
    return Node(DOMAIN).subscription(topic, PoseStamped)


def test_watchers_hear_state_effort_and_poses() -> None:
    prefix, states, _ = fresh()
    command = CompensatedController(law())
    watched = publish(f"ros2:/{prefix}?domain={DOMAIN}&rate=100", command)
    joints = Node(DOMAIN).subscription(states, JointState)
    actual, reference = (
        received(f"{prefix}/tip/{kind}") for kind in ("actual", "reference")
    )
    q, v = start(), 0.1 * np.ones(7)
    for t in (0.0, 0.004, 0.010):  # the second is too early for 100 Hz
        tau = command.effort(t, q, v, 0.001)
        watched(t)
    reported = joints.take()
    assert len(reported) == len(actual.take()) == 2
    state = reported[-1].message
    assert (state.name, state.position) == (list(panda().dof_names), q.tolist())
    assert (state.velocity, state.effort) == (v.tolist(), tau.tolist())
    pose = reference.take()[-1].message
    expected, _ = command.controller.tasks[0].measure(command.state)
    point = pose.pose.position
    assert [point.x, point.y, point.z] == expected.tolist()
    assert pose.pose.orientation.w == 1.0
    assert pose.header.frame_id == "panda_link0"
    assert pose.header.stamp == state.header.stamp


def test_a_pose_has_its_orientation_and_a_plane_is_no_pose() -> None:
    prefix, _, _ = fresh()
    gains = Gains(natural_frequency=5.0)
    pose = FramePose("panda_tcp", StreamPose(), gains=gains, name="whole-hand")
    plane = FramePosition("panda_link5", Stream(), axes="x", gains=gains, name="plane")
    command = CompensatedController(Controller(panda(), [pose, plane]))
    watched = publish(f"ros2:/{prefix}?domain={DOMAIN}", command)
    hand, flat = (
        received(f"{prefix}/whole_hand/actual"),
        received(f"{prefix}/plane/actual"),
    )
    command.effort(0.0, start(), REST, 0.001)
    watched(0.0)
    found = hand.take()[0].message.pose
    _, actual = command.controller.tasks[0].measure(command.state)
    reported = [*vars(found.position).values(), *vars(found.orientation).values()]
    assert reported == actual.tolist()
    assert flat.take() == []


def test_a_point_along_two_axes_is_no_pose() -> None:
    prefix, _, _ = fresh()
    flat = FramePosition("panda_tcp", Stream(), axes="xy", name="flat")
    command = CompensatedController(Controller(panda(), [flat]))
    watched = publish(f"ros2:/{prefix}?domain={DOMAIN}", command)
    poses = received(f"{prefix}/flat/actual")
    command.effort(0.0, start(), REST, 0.001)
    watched(0.0)
    assert poses.take() == []


@pytest.mark.parametrize(("address", "message"), [
    ("ros2://a?rate=0", r"the rate is '0'; needs a number above 0"),
    ("ros2://a?rate=fast", r"the rate is 'fast'; needs"),
    ("ros2://a?rates=1", r"unknown option 'rates'; did you mean 'rate'\?"),
])  # fmt: skip
def test_mistakes_are_named(address: str, message: str) -> None:
    with pytest.raises(HardwareError, match=message):
        publish(address, CompensatedController(law()))
