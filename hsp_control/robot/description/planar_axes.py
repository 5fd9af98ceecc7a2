"""The axes of a URDF's planar joints, written as Pinocchio reads them.

An ``<axis>`` is the normal of the plane, about which the joint turns. Pinocchio's plane
is always x-y: so the joint gets an extra link in between, whose z axis is the
normal, and to which the child is fixed as it was.
"""

from collections.abc import Sequence
from xml.etree.ElementTree import Element, SubElement

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array

_UP = np.array([0.0, 0.0, 1.0])


def write_planar_axes(robot: Element) -> None:
    """Turn the planar joints of a URDF into the plane of their axis, in place.

    Without ``<axis>`` the plane is x-y: there Pinocchio and MoveIt differ from the
    specification, where it would be y-z.
    """
    for joint in robot.findall("joint"):
        axis, child = joint.find("axis"), joint.find("child")
        if joint.get("type") != "planar" or axis is None or child is None:
            continue
        normal = np.array([float(word) for word in axis.get("xyz", "1 0 0").split()])
        size = float(np.linalg.norm(normal))
        if size == 0.0 or np.allclose(normal / size, _UP, rtol=0.0, atol=1e-12):
            continue
        turn = pin.Quaternion.FromTwoVectors(_UP, normal).matrix()
        origin = joint.find("origin")
        if origin is None:
            origin = SubElement(joint, "origin")
        rpy = [float(word) for word in origin.get("rpy", "0 0 0").split()]
        origin.set("rpy", _text(pin.rpy.rpyToMatrix(*rpy) @ turn))
        name = f"{joint.get('name', '')}.plane"
        SubElement(robot, "link", name=name)
        # of its own: a frame is looked up by its name where joints are locked
        back = SubElement(robot, "joint", name=f"{name}_back", type="fixed")
        SubElement(back, "parent", link=name)
        SubElement(back, "child", link=child.get("link", ""))
        SubElement(back, "origin", rpy=_text(turn.T))
        child.set("link", name)
        axis.set("xyz", "0 0 1")


def _text(rotation: Array) -> str:
    """Return the roll, pitch and yaw of a rotation (3, 3) as a URDF has them."""
    angles: Sequence[float] = pin.rpy.matrixToRpy(rotation).tolist()
    return " ".join(map(repr, angles))
