"""Targets on a topic of ROS 2: poses, or a joystick's twists.

They are ``geometry_msgs/msg/PoseStamped`` and ``TwistStamped``.
"""

from collections.abc import Callable, Mapping
from functools import partial
from time import monotonic
from typing import TYPE_CHECKING, Any
from weakref import ref

from hsp_control.common.errors import HardwareError, StreamError
from hsp_control.companions.ros2.address import SCHEME as SCHEME
from hsp_control.companions.ros2.address import TopicAddress, parse
from hsp_control.companions.ros2.installed import check_installed
from hsp_control.trajectories.streams.inbox import Inbox
from hsp_control.trajectories.streams.message import Space

if TYPE_CHECKING:
    from hsp_control.companions.ros2.messages import PoseStamped, TwistStamped
    from hsp_control.companions.ros2.node import Subscription

    AnyTarget = PoseStamped | TwistStamped

_POLL = 0.2
"""Time until a listener notices that its stream is gone [s]."""
_WORLD = "world"


def check_address(source: str) -> TopicAddress:
    """Parse an address ``ros2://TOPIC?type=twist&frame=NAME&domain=N``."""
    try:
        address = parse(source, ("type", "frame", "tool"))
    except HardwareError as error:
        raise StreamError(f"source is {source!r}: {error}") from None
    kind = address.options.get("type", "pose")
    if kind not in {"pose", "twist"}:
        raise StreamError(
            f"source is {source!r}: type is {kind!r}; needs pose or twist"
        )
    if kind == "pose" and "tool" in address.options:
        raise StreamError(
            f"source is {source!r}: a tool is only for type=twist; poses are in the "
            "stream's frame"
        )
    return address


def is_local(source: str) -> bool:
    """Return False: any computer may join a domain."""
    return False


def opened(source: str, space: Space) -> Callable[["ref[Inbox]"], None]:
    """Join the domain of an address; return the listener of its topic."""
    address = check_address(source)
    twists = address.options.get("type") == "twist"
    if space.linear not in {0, 3} or not space.width:
        what, width = ("twists", space.rates) if twists else ("poses", space.width)
        raise StreamError(f"{source} carries {what}; this stream needs {width} numbers")
    try:
        check_installed()
        from hsp_control.companions.ros2.messages import PoseStamped, TwistStamped
        from hsp_control.companions.ros2.node import Node

        kind: type[Any] = TwistStamped if twists else PoseStamped
        subscription = Node(address.domain).subscription(address.name, kind)
    except HardwareError as error:
        raise StreamError(f"{source}: {error}") from error
    return partial(_listen, subscription, address.options, space)


def _listen(
    subscription: "Subscription[Any]",
    options: Mapping[str, str],
    space: Space,
    inbox: "ref[Inbox]",
) -> None:
    """Put every target into the inbox while it exists."""
    while inbox() is not None:
        taken = subscription.take() if subscription.wait(_POLL) else []
        if there := inbox():
            now = monotonic()
            there.note_silence(now)
            for message, publisher in taken:
                stamp = message.header.stamp.nanoseconds
                try:
                    data = _said(message, options, space)
                    data["t"] = stamp / 1e9 if stamp else None  # without one: now
                    there.receive(f"publisher {publisher}", now, data)
                except StreamError as error:
                    there.reject(str(error))
        del there


def _said(
    message: "AnyTarget", options: Mapping[str, str], space: Space
) -> dict[str, Any]:
    """Return a stream's command of a message; see `message_of`."""
    named, frame = message.header.frame_id, options.get("frame", _WORLD)
    if hasattr(message, "pose"):
        _check_frame("a pose", named, [frame])
        p, r = message.pose.position, message.pose.orientation
        return {"value": _numbers([p.x, p.y, p.z], [r.x, r.y, r.z, r.w], space)}
    tool = options.get("tool")
    _check_frame("a twist", named, [frame] if tool is None else [frame, tool])
    u, w = message.twist.linear, message.twist.angular
    velocity = _numbers([u.x, u.y, u.z], [w.x, w.y, w.z], space)
    axes = {"": None, frame: "world", tool: "tool"}[named]
    return {"velocity": velocity, "axes": axes}


def _check_frame(what: str, named: str, known: list[str]) -> None:
    if named and named not in known:
        needed = " or ".join(map(repr, known))
        raise StreamError(f"{what} is in frame {named!r:.40}; needs {needed}")


def _numbers(linear: list[float], angular: list[float], space: Space) -> list[float]:
    """Return the part of a target that a stream uses."""
    return (linear if space.linear else []) + (angular if space.rotational else [])
