"""Targets on a topic of ROS 2: ``geometry_msgs/msg/PoseStamped``."""

from collections.abc import Callable
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING
from weakref import ref

from hsp_control.common.exceptions import HardwareError, StreamError
from hsp_control.companions.ros2.address import SCHEME as SCHEME
from hsp_control.companions.ros2.address import TopicAddress, parse
from hsp_control.companions.ros2.installed import check_installed
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space

if TYPE_CHECKING:
    from hsp_control.companions.ros2.messages import PoseStamped
    from hsp_control.companions.ros2.node import Subscription

_POLL = 0.2
"""How soon a listener notices that nobody needs it any more [s]."""
_WORLD = "world"


def check_address(source: str) -> TopicAddress:
    """Return what an address ``ros2://TOPIC?frame=NAME&domain=N`` says."""
    try:
        return parse(source, ("frame",))
    except HardwareError as error:
        raise StreamError(f"source is {source!r}: {error}") from None


def is_local(source: str) -> bool:
    """Return False: any computer may join a domain."""
    return False


def opened(source: str, space: Space) -> Callable[["ref[Inbox]"], None]:
    """Join the domain of an address; return what listens to its topic."""
    address = check_address(source)
    if space.linear not in {0, 3} or not space.width:
        raise StreamError(
            f"{source} carries poses; this stream needs {space.width} numbers"
        )
    try:
        check_installed()
        from hsp_control.companions.ros2.messages import PoseStamped
        from hsp_control.companions.ros2.node import Node

        subscription = Node(address.domain).subscription(address.name, PoseStamped)
    except HardwareError as error:
        raise StreamError(f"{source}: {error}") from error
    frame = address.options.get("frame", _WORLD)
    return partial(_listen, subscription, frame, space)


def _listen(
    subscription: "Subscription[PoseStamped]",
    frame: str,
    space: Space,
    inbox: "ref[Inbox]",
) -> None:
    """Put every pose into the inbox for as long as it is there."""
    while inbox() is not None:
        taken = subscription.take() if subscription.wait(_POLL) else []
        if there := inbox():
            now = monotonic()
            there.note_silence(now)
            for message, publisher in taken:
                _put(there, message, f"publisher {publisher}", now, frame, space)
        del there


def _put(
    inbox: Inbox,
    message: "PoseStamped",
    publisher: str,
    now: float,
    frame: str,
    space: Space,
) -> None:
    header, pose = message.header, message.pose
    if header.frame_id not in {"", frame}:
        inbox.reject(f"a pose is in the frame {header.frame_id!r:.40}; needs {frame!r}")
        return
    p, r = pose.position, pose.orientation
    value = [p.x, p.y, p.z] if space.linear else []
    if space.rotational:
        value += [r.x, r.y, r.z, r.w]
    stamp = header.stamp.nanoseconds
    try:  # without a stamp: now
        t = stamp / 1e9 if stamp else None
        inbox.receive(publisher, now, {"value": value, "t": t})
    except StreamError as error:
        inbox.reject(str(error))
