"""A participant in a DDS domain: publishers and subscriptions as of ROS 2.

It needs no ROS 2 and no router. ROS 2 lists the topics, without the name of a node. The
network is configured in Cyclone DDS: its ``CYCLONEDDS_URI`` chooses interfaces and
peers.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from math import ceil
from time import monotonic
from typing import Generic, NamedTuple, TypeVar

from cyclonedds.builtin import (
    BuiltinDataReader,
    BuiltinTopic,
    BuiltinTopicDcpsPublication,
    BuiltinTopicDcpsSubscription,
)
from cyclonedds.core import (
    DDSException,
    InstanceState,
    Policy,
    Qos,
    ReadCondition,
    SampleState,
    ViewState,
    WaitSet,
)
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import IdlStruct
from cyclonedds.internal import InvalidSample, SampleInfo
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic

from hsp_control.common.errors import HardwareError
from hsp_control.common.suggestions import listing
from hsp_control.companions.ros2.messages import TYPE_HASHES, ros_name

M = TypeVar("M", bound=IdlStruct)

_DEPTH = 16
"""Maximum number of messages queued in a subscription; beyond it the oldest are
lost."""
_SLICE = 0.1
"""Maximum duration of one wait [s]: Ctrl-C is noticed between two."""
_ENDPOINTS = 10_000
"""Maximum number of publishers searched to explain why one is missing."""


class ReceivedMessage(NamedTuple, Generic[M]):
    """A message that arrived.

    Attributes:
        message: The message.
        publisher: A number that identifies its publisher.
    """

    message: M
    publisher: int


class Node:
    """A participant in a domain.

    Attributes:
        domain: The number of the domain.
    """

    def __init__(self, domain: int) -> None:
        """Join the domain."""
        self.domain = domain
        with _explained(f"cannot join the DDS domain {domain}"):
            self._participant = DomainParticipant(domain)

    def publisher(self, topic: str, kind: type[M]) -> "TopicPublisher[M]":
        """Return a publisher of a topic; reliable, as ROS 2's are by default."""
        return TopicPublisher(self._participant, topic, kind)

    def subscription(self, topic: str, kind: type[M]) -> "Subscription[M]":
        """Return a subscription of a topic; best effort, to match any publisher.

        A state that was lost is not sent again: the next one is newer.
        """
        return Subscription(self._participant, topic, kind)


class _End(Generic[M]):
    """The common part of both ends of a topic: its name, and its counterparts.

    Attributes:
        topic: The topic's name in ROS 2.
        kind: The type of its messages.
    """

    def __init__(
        self, participant: DomainParticipant, topic: str, kind: type[M]
    ) -> None:
        self._participant = participant
        self.topic, self.kind = topic, kind
        with _explained(f"cannot open {topic}"):
            self._topic = Topic(participant, f"rt{topic}", kind)

    @property
    def _user_data(self) -> Policy.Userdata:
        return Policy.Userdata(f"typehash=RIHS01_{TYPE_HASHES[self.kind]};".encode())

    def _others(self, builtin: BuiltinTopic, end: str) -> str:
        """Return the endpoints that exist instead of a matching one."""
        reader = BuiltinDataReader(self._participant, builtin)
        there = {
            (each.topic_name, each.type_name)
            for each in reader.read(_ENDPOINTS)
            if not isinstance(each, InvalidSample) and each.topic_name[:3] == "rt/"
        }
        needed = self.kind.__idl_typename__
        here = [kind for name, kind in there if name == f"rt{self.topic}"]
        if wrong := [ros_name(kind) for kind in here if kind != needed]:
            return f"{self.topic} has type {wrong[0]}; needs {ros_name(needed)}"
        if here:
            return (
                f"{self.topic} has the right type, but its quality of service or its "
                "definition of the type differs"
            )
        same = sorted(name[2:] for name, kind in there if kind == needed)
        return (
            f"no {end} of {self.topic} in domain {self._participant.get_domain_id()} "
            f"(topics with {ros_name(needed)}: {listing(same) if same else 'none'})"
        )


class TopicPublisher(_End[M]):
    """Publishes messages on a topic."""

    def __init__(
        self, participant: DomainParticipant, topic: str, kind: type[M]
    ) -> None:
        """Open the topic."""
        super().__init__(participant, topic, kind)
        qos = Qos(
            Policy.Reliability.Reliable(max_blocking_time=0),
            Policy.Durability.Volatile,
            Policy.History.KeepLast(1),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            self._user_data,
        )
        with _explained(f"cannot publish {topic}"):
            self._writer = DataWriter(participant, self._topic, qos)

    def send(self, message: M) -> None:
        """Send a message, without waiting."""
        with _explained(f"cannot publish {self.topic}"):
            self._writer.write(message)

    @property
    def matched(self) -> int:
        """Number of subscriptions that receive it."""
        return len(self._writer.get_matched_subscriptions())

    def why_none(self) -> str:
        """Return why it has no subscriber, as far as can be detected."""
        return self._others(BuiltinTopicDcpsSubscription, "subscriber")


class Subscription(_End[M]):
    """Receives messages of a topic.

    Attributes:
        malformed: Number of messages with a text that is not UTF-8.
    """

    def __init__(
        self, participant: DomainParticipant, topic: str, kind: type[M]
    ) -> None:
        """Open the topic."""
        super().__init__(participant, topic, kind)
        self.malformed = 0
        qos = Qos(
            Policy.Reliability.BestEffort,
            Policy.Durability.Volatile,
            Policy.History.KeepLast(_DEPTH),
            Policy.DataRepresentation(use_cdrv0_representation=True),
            self._user_data,
        )
        with _explained(f"cannot receive {topic}"):
            self._reader = DataReader(participant, self._topic, qos)
            new = SampleState.NotRead | ViewState.Any | InstanceState.Any
            self._new = ReadCondition(self._reader, new)
            self._waiting = WaitSet(participant)
            self._waiting.attach(self._new)

    @property
    def matched(self) -> int:
        """Number of publishers that it receives."""
        return len(self._reader.get_matched_publications())

    def why_none(self) -> str:
        """Return why it has no publisher, as far as can be detected."""
        return self._others(BuiltinTopicDcpsPublication, "publisher")

    def wait(self, timeout: float) -> bool:
        """Wait until a message is available; return whether one is."""
        end = monotonic() + timeout
        while True:
            left = max(end - monotonic(), 0.0)
            if self._waiting.wait(ceil(1e9 * min(left, _SLICE))):
                return True
            if left <= _SLICE:
                return False

    def take(self) -> list[ReceivedMessage[M]]:
        """Return the queued messages, oldest first.

        One with a text that is not UTF-8 is counted and dropped. Cyclone DDS drops
        other bytes that are not a message of the type.
        """
        found: list[ReceivedMessage[M]] = []
        for _ in range(_DEPTH):
            try:
                taken = self._reader.take(1)
            except DDSException as error:
                raise HardwareError(f"cannot receive {self.topic}: {error}") from error
            except UnicodeDecodeError:  # Cyclone has checked everything else
                self.malformed += 1
                continue
            if not taken:
                break
            if not isinstance(
                taken[0], InvalidSample
            ):  # those report that a publisher left
                info: SampleInfo = taken[0].sample_info  # type: ignore[attr-defined]
                found.append(ReceivedMessage(taken[0], info.publication_handle))
        return found


@contextmanager
def _explained(what: str) -> Iterator[None]:
    try:
        yield
    except DDSException as error:
        raise HardwareError(f"{what}: {error}") from error
