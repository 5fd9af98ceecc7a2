"""The robot's own model as a URDF: its calibrated arm, end effector and load."""

from copy import deepcopy
from typing import Any
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin

from hsp_control.common.errors import ModelError
from hsp_control.robot import Robot
from hsp_control.robot.description.access import XmlError, parse_xml
from hsp_control.robot.description.urdf import read_urdf

_FLANGE = "link8"
_CARRIED = "carried"
"""The added link: end effector and load."""
_OF_A_JOINT = ("origin", "axis", "limit")


def own_model(urdf: str, carried: dict[str, Any], tool: list[float]) -> str:
    """Return the robot's URDF with its load.

    Two links are added to the flange: ``carried`` has the mass of end effector and
    load, ``end_effector`` is the frame set in Desk.
    """
    top = _parsed(urdf)
    _carry(top, _flange(top), carried)
    placement = np.array(tool).reshape(4, 4).T
    _attach(top, _flange(top), "end_effector", placement)
    return _text(top)


def calibrated(urdf: str, carried: dict[str, Any], like: Robot) -> str:
    """Return another description of the arm with the robot's kinematics and inertias.

    Names, frames and shapes are those of `like`, so that configurations for it can be
    used. Links beyond the flange lose their masses to ``carried``, and the fingers
    stay closed.
    """
    own, top = _parsed(urdf), read_urdf(like.source)
    names = list(like.dof_names)
    joints = {joint.get("name", ""): joint for joint in top.findall("joint")}
    if len(names) != 7:
        raise ModelError(f"{like.name} has {len(names)} moving joints; needs seven")
    _replace_inertia(_link(top, _parent(joints[names[0]])), _link(own, "link0"))
    for number, name in enumerate(names, 1):
        theirs = _joint(own, f"joint{number}")
        joint = joints[name]
        for tag in _OF_A_JOINT:
            for each in joint.findall(tag):
                joint.remove(each)
            joint.extend(deepcopy(theirs.findall(tag)))
        _replace_inertia(_link(top, _child(joint)), _link(own, f"link{number}"))
    flange = _flange(top)
    for name in _beyond(top, flange):
        _replace_inertia(_link(top, name), None)
    for joint in joints.values():
        if joint.get("name") not in names and joint.get("type") != "fixed":
            joint.set("type", "fixed")
            for each in joint.findall("mimic"):
                joint.remove(each)
    _carry(top, flange, carried)
    return _text(top)


def _parsed(urdf: str) -> Element:
    try:
        return parse_xml(urdf.encode())
    except XmlError as error:
        raise ModelError(error.within("the robot's description")) from None


def _text(top: Element) -> str:
    ElementTree.indent(top)
    return ElementTree.tostring(top, encoding="unicode", xml_declaration=True) + "\n"


def _named(top: Element, tag: str, name: str) -> Element:
    """Return the link or joint whose name has this ending: ``link3``, ``fr3_link3``."""
    for each in top.findall(tag):
        own = each.get("name", "")
        if own == name or own.endswith(f"_{name}"):
            return each
    raise ModelError(f"the description has no {tag} {name}, as a Franka arm's has")


def _link(top: Element, name: str) -> Element:
    return _named(top, "link", name)


def _joint(top: Element, name: str) -> Element:
    return _named(top, "joint", name)


def _flange(top: Element) -> str:
    return _link(top, _FLANGE).get("name", "")


def _parent(joint: Element) -> str:
    return joint.find("parent").get("link", "")  # type: ignore[union-attr]


def _child(joint: Element) -> str:
    return joint.find("child").get("link", "")  # type: ignore[union-attr]


def _beyond(top: Element, flange: str) -> list[str]:
    """Return the flange and all links attached to it."""
    found = [flange]
    joints = top.findall("joint")
    for name in found:  # the list grows during the loop
        found += [_child(joint) for joint in joints if _parent(joint) == name]
    return found


def _replace_inertia(link: Element, source: Element | None) -> None:
    for each in link.findall("inertial"):
        link.remove(each)
    if source is not None:
        link[:0] = deepcopy(source.findall("inertial"))


def _carry(top: Element, flange: str, carried: dict[str, Any]) -> None:
    if carried["mass"] <= 0.0:
        return
    link = _attach(top, flange, _CARRIED, np.eye(4))
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(carried["center"]))
    ElementTree.SubElement(inertial, "mass", value=repr(float(carried["mass"])))
    inertia = np.array(carried["inertia"]).reshape(3, 3)
    names = {
        f"i{'xyz'[i]}{'xyz'[j]}": repr(float(inertia[i, j]))
        for i in range(3)
        for j in range(i, 3)
    }
    ElementTree.SubElement(inertial, "inertia", names)


def _attach(top: Element, parent: str, name: str, placement: Any) -> Element:
    link = ElementTree.SubElement(top, "link", name=name)
    joint = ElementTree.SubElement(top, "joint", name=f"{name}_joint", type="fixed")
    ElementTree.SubElement(joint, "parent", link=parent)
    ElementTree.SubElement(joint, "child", link=name)
    turn = pin.rpy.matrixToRpy(placement[:3, :3])
    ElementTree.SubElement(
        joint, "origin", xyz=_numbers(placement[:3, 3]), rpy=_numbers(turn)
    )
    return link


def _numbers(values: Any) -> str:
    return " ".join(repr(float(value)) for value in values)
