"""The frame of a robot that is most likely its hand, and the reason."""

import re
from collections.abc import Sequence
from typing import NamedTuple

import pinocchio as pin

from hsp_control.common.suggestions import listing

_MOVING_PART = "finger|thumb|digit|jaw|knuckle|claw|pincer"
_GRIPPER = re.compile(f"{_MOVING_PART}|gripper")
_PART = re.compile(_MOVING_PART)
"""Names of links that a gripper's joint moves; a wrist may move a gripper, too."""
_ARM = re.compile("wrist|roll|pitch|yaw|rotat|flex")
"""Names of joints that move a gripper, unless they also name an arm's joint."""
_NO_HAND = re.compile(
    "finger|thumb|digit|camera|imu|sensor|range|accelerometer|laser|optical|force"
    "|(^|_)ft_frame"
)
"""Names of links on a last joint that are less likely the hand than others."""
_HANDS = (
    ("a TCP", re.compile("tcp|tool_?cent")),
    ("a tool", re.compile("tool0|(hand|gripper).*_tool")),  # no flange: arm_tool_link
    ("a place to grasp", re.compile("grasp|gripper_frame")),
    ("an end effector", re.compile("end_?effector|(^|_)eef?(_|$)")),
)
"""Names of links that are meant as the hand, the likeliest first."""


class Hand(NamedTuple):
    """The frame that is most likely the hand."""

    frame: str
    why: str  # why it was chosen


def find_hand(model: pin.Model) -> Hand:
    """Return the hand, found from the kinematic tree and from names.

    It is a link on the last joint of the longest chain of joints. Joints at the end of
    a chain that are called a jaw's, finger's or gripper's, or move a link that is, are
    no part of the arm. Where the chain branches in its second half into three or more,
    or into two of similar lengths, these are fingers, and it ends there. One much
    shorter branch does not end it: it is a part of the arm's mechanism. Of the links on
    that joint one that is called a TCP, a place to grasp, a tool or an end effector
    comes first, then the last one, no finger or sensor if possible.
    """
    whole: list[list[int]] = [[]]
    for joint in range(1, model.njoints):
        whole.append([*whole[model.parents[joint]], joint])
    chains = [(_without_gripper(model, chain), chain) for chain in whole]
    arm, chain = max(reversed(chains), key=lambda each: len(each[0]))
    branching = [
        joint
        for depth, joint in enumerate(arm, start=1)
        if 2 * depth >= len(arm) and _carries_fingers(whole, joint)
    ]
    end = branching[0] if branching else arm[-1]
    why = f"the longest chain of joints ends with {model.names[end]!r}"
    if branching:
        why += ", where fingers branch off"
    elif gripper := [repr(model.names[joint]) for joint in chain[len(arm) :]]:
        why += f": {listing(gripper)} after it {_is(gripper)} a gripper's"
    there = [frame for frame in model.frames if frame.parentJoint == end]
    links = [frame.name for frame in there if frame.type == pin.FrameType.BODY]
    if not links:  # a user's model may have no links
        links = [frame.name for frame in (there or model.frames)]
    hands = [link for link in links if not _NO_HAND.search(link.lower())] or links
    for what, name in _HANDS:
        called = [link for link in hands if name.search(link.lower())]
        if called and len(links) > 1:
            return Hand(str(called[-1]), f"{why}, and this link is called {what}")
    last = ", and this is its last link" if len(links) > 1 else ""
    return Hand(str(hands[-1]), why + last)


def _is(several: Sequence[str]) -> str:
    return "are" if len(several) > 1 else "is"


def _without_gripper(model: pin.Model, chain: Sequence[int]) -> list[int]:
    """Return a chain without the joints at its end that move a gripper's parts."""
    arm = [*chain]
    while arm and _grips(model, arm[-1]):
        arm.pop()
    return arm or [*chain]


def _grips(model: pin.Model, joint: int) -> bool:
    """Return whether a joint, or the link that it moves, has a gripper's name."""
    name = model.names[joint].lower()
    if _ARM.search(name):
        return False
    links = (
        frame.name.lower()
        for frame in model.frames
        if frame.parentJoint == joint and frame.type == pin.FrameType.BODY
    )
    return bool(_GRIPPER.search(name) or _PART.search(next(links, "")))


def _carries_fingers(chains: Sequence[Sequence[int]], joint: int) -> bool:
    """Return whether the chains beyond a joint are three, or two of similar lengths."""
    beyond: dict[int, int] = {}  # the longest chain, by its first joint
    for chain in chains:
        if joint in chain[:-1]:
            after = chain[chain.index(joint) + 1 :]
            beyond[after[0]] = max(beyond.get(after[0], 0), len(after))
    lengths = sorted(beyond.values())
    return len(lengths) > 2 or (len(lengths) == 2 and 2 * lengths[0] > lengths[1])
