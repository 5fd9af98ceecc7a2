"""Mimic joints of a URDF, written so that Pinocchio reads them.

A follower is at q_f = m q_l + o where its leader is at q_l. Pinocchio supports no
follower of a follower, none that precedes its leader in the tree, and none of another
kind of configuration; and it ignores limits and friction of a follower. So a chain is
written as followers of its first joint, a leader that comes too late as a separate
coordinate, which it follows itself, and limits and friction of a follower as those of
its leader. All of this is the same motion.
"""

import logging
import math
from collections.abc import Iterator, Mapping, Sequence
from copy import deepcopy
from typing import NamedTuple
from xml.etree.ElementTree import Element, SubElement

import pinocchio as pin

from hsp_control.common.errors import ModelError
from hsp_control.common.suggestions import did_you_mean

_SINGLE = ("revolute", "continuous", "prismatic")
"""Types of joints with one degree of freedom, which can lead and follow."""
_NEEDED = {"limit": ("effort", "velocity"), "dynamics": ("damping", "friction")}
"""Attributes without which the parser refuses an element."""
_FIRST = "!"
"""Prefix of a coordinate's name while Pinocchio reads it. Joints of a link
come in the order of their names: so it is the first."""
_COORDINATE, _DRIVEN = ".coordinate", ".driven"
"""Suffix of the names of a coordinate's frames, and of the joint that follows it."""
_HINT = "load its mimic joints as independent joints with mimic=False"

_log = logging.getLogger(__name__)


class Follower(NamedTuple):
    """A joint that is at ``multiplier`` · leader + ``offset``."""

    name: str
    leader: str  # a joint that follows no other one
    multiplier: float
    offset: float  # [rad or m]

    def leaders_range(self, joints: Mapping[str, Element]) -> tuple[float, float]:
        """Return the leader's own position limits."""
        return _range(joints[self.leader])

    def bounds(self, joint: Element) -> tuple[float, float]:
        """Return the range of the leader that the follower's own limits allow."""
        ends = [(x - self.offset) / self.multiplier for x in _range(joint)]
        return min(ends), max(ends)


def followers(robot: Element) -> list[Follower]:
    """Return all followers, with the joints that chains end in.

    Raises:
        ModelError: If a joint mimics none that moves, or itself.
    """
    joints = {each.get("name", ""): each for each in robot.findall("joint")}
    mimics = {
        name: mimic
        for name, joint in joints.items()
        if (mimic := joint.find("mimic")) is not None and joint.get("type") != "fixed"
    }
    found = []
    for name in mimics:
        way, multiplier, offset = [name], 1.0, 0.0
        while (mimic := mimics.get(way[-1])) is not None:
            leader = mimic.get("joint", "")
            if leader in way:
                raise ModelError(
                    f"joint {way[-1]!r} mimics {leader!r}, which follows "
                    f"{'it' if len(way) > 1 else 'itself'}; {_HINT}"
                )
            for each, does in ((way[-1], "mimics"), (leader, "is mimicked")):
                kind = joints[each].get("type") if each in joints else "fixed"
                if does == "is mimicked" and kind == "fixed":
                    near = "" if leader in joints else did_you_mean(leader, joints)
                    raise ModelError(
                        f"joint {way[-1]!r} mimics {leader!r}, which is not a moving "
                        f"joint{near}; {_HINT}"
                    )
                if kind not in _SINGLE:
                    raise ModelError(
                        f"joint {each!r} {does} but is {kind}; must be one of "
                        f"{', '.join(_SINGLE)}; {_HINT}"
                    )
            offset += multiplier * float(mimic.get("offset", 0.0))
            multiplier *= float(mimic.get("multiplier", 1.0))
            way.append(leader)
        found.append(Follower(name, way[-1], multiplier, offset))
    return found


def write_for_pinocchio(robot: Element) -> None:
    """Write all mimic joints of a URDF as Pinocchio reads them, in place.

    Raises:
        ModelError: If a joint mimics none that moves, or itself.
    """
    found = followers(robot)
    joints = {each.get("name", ""): each for each in robot.findall("joint")}
    for name in dict.fromkeys(each.leader for each in found):
        own = [each for each in found if each.leader == name]
        _unite_kinds(joints, own)
        for message in _bound_by_followers(joints, own):
            _log.warning("%s", message)
    for each in found:
        _follow(joints[each.name], each.leader, each.multiplier, each.offset)
    if found:
        _give_coordinates(robot, joints, found)


def name_coordinates(model: pin.Model) -> None:
    """Give a coordinate its leader's name, and that joint another one.

    Joints are locked by these names. Until `name_frames`, the frames of both joints
    have their names: Pinocchio finds one by the other's name.
    """
    names = list(model.names)
    for name in names:
        if not name.startswith(_FIRST) or name.removeprefix(_FIRST) not in names:
            continue
        leader = name.removeprefix(_FIRST)
        for old, new in ((leader, leader + _DRIVEN), (name, leader)):
            model.names[names.index(old)] = new
            for frame in model.frames:
                if frame.name == old and frame.type == pin.FrameType.JOINT:
                    frame.name = new
                elif frame.name == old == name:
                    frame.name = leader + _COORDINATE


def name_frames(model: pin.Model) -> None:
    """Give the frame of a joint that follows its coordinate the joint's own name."""
    names = {frame.name for frame in model.frames}
    for driven in model.frames:
        leader = driven.name.removesuffix(_DRIVEN)
        if leader != driven.name and leader + _COORDINATE in names:
            for frame in model.frames:
                if frame.name == leader and frame.type != pin.FrameType.BODY:
                    frame.name = leader + _COORDINATE
            driven.name = leader


def _unite_kinds(joints: dict[str, Element], own: Sequence[Follower]) -> None:
    """Let a leader and its followers measure their angles in the same way.

    Of a continuous leader (cos, sin) is known, not the number of turns: that is
    enough for continuous followers at a whole multiple.
    """
    leader = joints[own[0].leader]
    turns = leader.get("type") == "continuous" and all(
        joints[each.name].get("type") == "continuous" and each.multiplier.is_integer()
        for each in own
    )
    for joint in (leader, *(joints[each.name] for each in own)):
        if joint.get("type") == "continuous" and not turns:
            joint.set("type", "revolute")
            for name in ("lower", "upper"):  # none
                _set(joint, "limit", name, 0.0)


def _bound_by_followers(
    joints: dict[str, Element], own: Sequence[Follower]
) -> Iterator[str]:
    """Apply followers' limits and friction to a leader; yield impossible ones."""
    leader = joints[own[0].leader]
    for each in own:
        follower, ratio = joints[each.name], abs(each.multiplier)
        if ratio == 0.0:
            continue
        lower, upper = _range(leader)
        low, high = each.bounds(follower)
        if max(lower, low) < min(upper, high):
            for name, end in (
                ("lower", max(lower, low)),
                ("upper", min(upper, high)),
            ):
                if math.isfinite(end):
                    _set(leader, "limit", name, end)
        else:
            yield (
                f"joint {each.name!r}: its position limits allow its leader "
                f"{each.leader!r} to be from {low:g} to {high:g}, whose own are "
                f"{lower:g} to {upper:g}: the follower's limits are ignored"
            )
        # power: m v_l is the follower's speed, and its effort is m times the leader's
        for name, scale in (("velocity", 1.0 / ratio), ("effort", ratio)):
            most = scale * _number(follower.find("limit"), name)
            given = _number(leader.find("limit"), name)
            if most > 0.0 and (given <= 0.0 or most < given):
                _set(leader, "limit", name, most)
        for name, scale in (("damping", ratio**2), ("friction", ratio)):
            more = scale * _number(follower.find("dynamics"), name)
            if more:
                own_share = _number(leader.find("dynamics"), name)
                _set(leader, "dynamics", name, own_share + more)


def _give_coordinates(
    robot: Element, joints: dict[str, Element], found: Sequence[Follower]
) -> None:
    """Let leaders that come after a follower follow a joint that comes before all.

    That joint moves no body: it is a coordinate only.
    """
    text = _skeleton(robot)
    try:
        order = list(pin.buildModelFromXML(text, mimic=False).names)
    except (ValueError, RuntimeError):  # reported when the model itself is built
        return
    late = [f.leader for f in found if order.index(f.leader) > order.index(f.name)]
    children = {_end(joint, "child") for joint in joints.values()}
    names = [link.get("name", "") for link in robot.findall("link")]
    root = next(name for name in names if name not in children)
    for leader in dict.fromkeys(late):
        name = _FIRST + leader
        SubElement(robot, "link", name=name)
        joint = deepcopy(joints[leader])
        joint.set("name", name)
        for tag, link in (("parent", root), ("child", name)):
            _child(joint, tag).set("link", link)
        if (origin := joint.find("origin")) is not None:
            joint.remove(origin)
        robot.append(joint)
        _follow(joints[leader], name, 1.0, 0.0)
        for each in found:
            if each.leader == leader:
                _follow(joints[each.name], name, each.multiplier, each.offset)


def _skeleton(robot: Element) -> str:
    """Return the text of the links and joints alone."""
    from hsp_control.robot.description.urdf import parser_text

    return parser_text(deepcopy(robot), "visual", "collision")


def _follow(joint: Element, leader: str, multiplier: float, offset: float) -> None:
    mimic = _child(joint, "mimic")
    mimic.set("joint", leader)
    mimic.set("multiplier", repr(multiplier))
    mimic.set("offset", repr(offset))


def _range(joint: Element) -> tuple[float, float]:
    """Return the position limits of a joint; two that are equal are none."""
    limit = joint.find("limit")
    lower, upper = _number(limit, "lower"), _number(limit, "upper")
    if lower > upper:
        raise ModelError(
            f"joint {joint.get('name')!r}: its lower limit {lower:g} is above its "
            f"upper limit {upper:g}"
        )
    if joint.get("type") == "continuous" or lower == upper:
        return -math.inf, math.inf
    return lower, upper


def _set(joint: Element, tag: str, name: str, value: float) -> None:
    """Set an attribute of a joint's element, which gets those that are required."""
    if (element := joint.find(tag)) is None:
        if tag == "limit" and joint.get("type") == "prismatic":
            return  # its limits are required, and the parser reports that
        element = SubElement(joint, tag)
    for needed in _NEEDED[tag]:
        element.set(needed, element.get(needed, "0"))
    element.set(name, repr(value))


def _number(element: Element | None, name: str) -> float:
    return 0.0 if element is None else float(element.get(name, 0.0))


def _child(element: Element, tag: str) -> Element:
    """Return an element's child, a new one if it has none."""
    child = element.find(tag)
    return SubElement(element, tag) if child is None else child


def _end(joint: Element, tag: str) -> str | None:
    end = joint.find(tag)
    return None if end is None else end.get("link")
