"""A plain DDS client as a program: it imports Cyclone DDS and no code of ours.

Its types are defined again, from ROS 2's definitions. It runs in lockstep with its
peer, and prints its results as JSON.

    python dds_client.py drive DOMAIN CONTROLLER STATES COUNT
    python dds_client.py robot DOMAIN CONTROLLER STATES COUNT JOINT...
    python dds_client.py watch DOMAIN TOPIC COUNT
    python dds_client.py aim DOMAIN TOPIC X Y Z
"""

import json
import sys
from dataclasses import dataclass
from math import cos, sin
from time import monotonic

from cyclonedds.core import Policy, Qos, ReadCondition, WaitSet
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint32
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

GIVE_UP = 120.0
BACKWARDS = slice(None, None, -1)
"""The client lists joints in reverse order, which is permitted."""


@dataclass
class Time(IdlStruct, typename="builtin_interfaces::msg::dds_::Time_"):
    sec: int32
    nanosec: uint32


@dataclass
class Header(IdlStruct, typename="std_msgs::msg::dds_::Header_"):
    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs::msg::dds_::JointState_"):
    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Dimension(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayDimension_"):
    label: str
    size: uint32
    stride: uint32


@dataclass
class Layout(IdlStruct, typename="std_msgs::msg::dds_::MultiArrayLayout_"):
    dim: sequence[Dimension]
    data_offset: uint32


@dataclass
class Numbers(IdlStruct, typename="std_msgs::msg::dds_::Float64MultiArray_"):
    layout: Layout
    data: sequence[float64]


@dataclass
class Point(IdlStruct, typename="geometry_msgs::msg::dds_::Point_"):
    x: float64
    y: float64
    z: float64


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs::msg::dds_::Quaternion_"):
    x: float64
    y: float64
    z: float64
    w: float64


@dataclass
class Pose(IdlStruct, typename="geometry_msgs::msg::dds_::Pose_"):
    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs::msg::dds_::PoseStamped_"):
    header: Header
    pose: Pose


class Client:
    """A participant; its endpoints have the default settings of ROS 2."""

    def __init__(self, domain: int) -> None:
        self._participant = DomainParticipant(domain)
        self._waiting = WaitSet(self._participant)
        self._qos = Qos(
            Policy.Reliability.Reliable(duration(seconds=10)),
            Policy.History.KeepLast(9),
        )

    def reader(self, topic: str, kind: type) -> DataReader:
        there = Topic(self._participant, f"rt{topic}", kind)
        reader = DataReader(self._participant, there, self._qos)
        self._waiting.attach(ReadCondition(reader, 0x7F))
        return reader

    def writer(self, topic: str, kind: type) -> DataWriter:
        there = Topic(self._participant, f"rt{topic}", kind)
        return DataWriter(self._participant, there, self._qos)

    def next(self, reader: DataReader, patience: float = GIVE_UP) -> object | None:
        """Return the next message; None after a timeout."""
        end = monotonic() + patience
        while monotonic() < end:
            for each in reader.take(1):
                if each.sample_info.valid_data:
                    return each
            self._waiting.wait(duration(milliseconds=1))
        return None


def drive(client: Client, controller: str, states: str, count: int) -> list[object]:
    """Pull every joint to its first position, with efforts in the robot's order."""
    reader = client.reader(states, JointState)
    writer = client.writer(f"{controller}/commands", Numbers)
    first, log = None, []
    while len(log) < count:
        state = client.next(reader)
        assert state is not None
        if first is None:  # both ends have discovered each other
            if not writer.get_matched_subscriptions():
                continue
            first = state.position
        now = zip(first, state.position, state.velocity, strict=True)
        tau = [20.0 * (a - q) - 2.0 * v + k for k, (a, q, v) in enumerate(now)]
        writer.write(Numbers(Layout([], 0), tau[BACKWARDS]))
        log.append([state.name, state.position, state.velocity, state.effort, tau])
    writer.wait_for_acks(duration(seconds=GIVE_UP))
    return log


def robot(
    client: Client, controller: str, states: str, count: int, joints: list[str]
) -> list[object]:
    """Move arbitrarily, one step per received effort."""
    writer = client.writer(states, JointState)
    reader = client.reader(f"{controller}/commands", Numbers)
    start = [float(each.partition("=")[2]) for each in joints]
    names = [each.partition("=")[0] for each in joints]
    log, step, stamp = [], 0, 5_000_000_000
    end = monotonic() + GIVE_UP
    while step < count and monotonic() < end:
        t = 1e-3 * step
        q = [a + 0.05 * sin(t + k) - 0.05 * sin(k) for k, a in enumerate(start)]
        v = [0.05 * cos(t + k) for k in range(len(start))]
        stamp += 1_000_000
        header = Header(Time(*divmod(stamp, 1_000_000_000)), "")
        extra = ([0.5], ["gripper"])
        writer.write(
            JointState(
                header,
                extra[1] + names[BACKWARDS],
                extra[0] + q[BACKWARDS],
                extra[0] + v[BACKWARDS],
                [],
            )
        )
        received = client.next(reader, GIVE_UP if step else 1e-3)
        if received is not None:
            step += 1
            log.append([stamp, q, v, list(received.data)])
    return log


def watch(client: Client, topic: str, count: int) -> list[object]:
    """Receive poses."""
    reader = client.reader(topic, PoseStamped)
    found = (client.next(reader) for _ in range(count))
    return [
        [
            each.header.frame_id,
            each.header.stamp.sec + 1e-9 * each.header.stamp.nanosec,
            *vars(each.pose.position).values(),
            *vars(each.pose.orientation).values(),
        ]
        for each in found
    ]


if __name__ == "__main__":
    what, domain, *words = sys.argv[1:]
    client = Client(int(domain))
    if what == "drive":
        print(json.dumps(drive(client, *words[:2], int(words[2]))))
    elif what == "robot":
        print(json.dumps(robot(client, *words[:2], int(words[2]), words[3:])))
    elif what == "watch":
        print(json.dumps(watch(client, words[0], int(words[1]))))
