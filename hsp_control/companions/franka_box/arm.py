"""The arm of the box: its model, its limits and its end effector."""

from dataclasses import dataclass
from xml.etree import ElementTree

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import LiveError
from hsp_control.companions.franka.layouts import JOINTS
from hsp_control.robot import Robot
from hsp_control.robot.description.urdf import read_urdf

FLANGE = "link8"
"""Ending of the name of the flange's frame in Franka's descriptions."""
EFFORT_RATE = 1000.0
"""Maximum rate of the commanded effort [N·m/s]."""
ACCELERATION = 10.0
"""Maximum acceleration of a commanded motion [rad/s²]."""
JERK = 5000.0
"""Maximum jerk of a commanded motion [rad/s³].

These three are Research 3's for every joint: libfranka 0.21, ``rate_limiting.h``, and
"Limits for Franka Research 3" at https://frankarobotics.github.io/docs.
"""
ELBOW_FLIP = -0.467002423653011
"""Position of joint 4 at which the arm is stretched [rad]; the same page."""
_ANY_DECELERATION = 1e9
"""Value sent to clients if velocity limits do not depend on the position [rad/s²]."""


@dataclass(frozen=True)
class ArmLimits:
    """Limits of the joints, shapes (7,).

    Attributes:
        lower: Smallest positions [rad].
        upper: Largest positions [rad].
        velocity: Largest speeds [rad/s].
        effort: Largest efforts [N·m].
        velocity_offset: Of the velocity limits that depend on the position [rad/s].
        deceleration: Of the same [rad/s²]; inf: they do not depend on it.
    """

    lower: Array
    upper: Array
    velocity: Array
    effort: Array
    velocity_offset: Array
    deceleration: Array

    def velocities(self, q: Array) -> tuple[Array, Array]:
        """Return the lowest and highest velocities at q, shapes (7,) [rad/s].

            v_max(q) = min(v, max(0, -o + sqrt(2 d (q_upper - q))))

        and the same for v_min: libfranka 0.21, ``joint_velocity_limits.cpp``.
        """
        return -self._speed(q - self.lower), self._speed(self.upper - q)

    def _speed(self, room: Array) -> Array:
        """Return the maximum speed towards a limit at a distance [rad]."""
        depends = np.isfinite(self.deceleration)
        braking = np.where(depends, self.deceleration, 0.0)
        speed = np.sqrt(2.0 * braking * np.maximum(room, 0.0)) - self.velocity_offset
        return np.where(depends, np.clip(speed, 0.0, self.velocity), self.velocity)


class Arm:
    """A robot's arm of seven revolute joints, without the load at its flange.

    Attributes:
        robot: The arm with its end effector.
        limits: Limits of its joints.
        flange: Placement of the flange in the frame of the last joint.
        nominal_end_effector: Placement of the nominal end effector in the flange.
        end_effector: Its inertia in the flange's frame.
        urdf: The description sent to clients: the arm without its end effector.
    """

    def __init__(self, robot: Robot) -> None:
        """Check the robot, and split it at the flange.

        Raises:
            LiveError: If it is not a chain of seven revolute joints on a fixed base, or
                a joint has no limits.
            ModelError: If its URDF cannot be read.
        """
        _check_joints(robot)
        self.robot, self.limits = robot, _limits_of(robot)
        model = robot.model
        frames = [f for f in model.frames if f.parentJoint == JOINTS]
        flanges = [f.placement for f in frames if f.name.endswith(FLANGE)]
        self.flange: pin.SE3 = flanges[0] if flanges else pin.SE3.Identity()
        tool = model.frames[robot.frame_id(robot.end_effector)]
        on_the_hand = tool.parentJoint == JOINTS
        self.nominal_end_effector: pin.SE3 = (
            self.flange.actInv(tool.placement) if on_the_hand else pin.SE3.Identity()
        )
        # A body at the end of a fixed joint keeps its inertia in that joint's frame.
        self.end_effector: pin.Inertia = pin.Inertia.Zero()
        self._arm = model.copy()
        last = model.inertias[JOINTS].copy()
        for frame in frames:
            if flanges and frame.inertia.mass > 0.0:
                part = frame.placement.act(frame.inertia)
                self.end_effector += self.flange.actInv(part)
                last -= part
        self._arm.inertias[JOINTS] = last
        self.urdf = _urdf(self._arm, self.flange, self.limits, robot.name)

    def carrying(self, load: pin.Inertia) -> Robot:
        """Return the arm with its end effector and a load in the flange's frame."""
        model = self.robot.model.copy()
        model.inertias[JOINTS] += self.flange.act(load)
        return Robot(model, self.robot.source, self.robot.parts)


def _check_joints(robot: Robot) -> None:
    model = robot.model
    chain = list(model.parents)[1:] == list(range(model.njoints - 1))
    if not (chain and model.nq == model.nv == model.njoints - 1 == JOINTS):
        raise LiveError(
            f"{robot.name} has the joints {', '.join(robot.joint_names)}; the research "
            "interface is one of an arm of seven revolute joints on a fixed base: "
            "give another robot, or lock the others"
        )
    if not all(name.startswith("JointModelR") for name in _kinds(robot)):
        raise LiveError(
            f"{robot.name} has the joints {', '.join(_kinds(robot))}; the research "
            "interface needs seven revolute ones"
        )


def _kinds(robot: Robot) -> list[str]:
    return [joint.shortname() for joint in list(robot.model.joints)[1:]]


def _limits_of(robot: Robot) -> ArmLimits:
    model = robot.model
    numbers = {
        "lower": model.lowerPositionLimit,
        "upper": model.upperPositionLimit,
        "velocity": model.upperVelocityLimit,
        "effort": model.upperEffortLimit,
    }
    limits = {key: np.array(value, dtype=float) for key, value in numbers.items()}
    for key, value in limits.items():
        bare = ~np.isfinite(value) | ((key in {"velocity", "effort"}) & (value <= 0.0))
        for index in np.flatnonzero(bare):
            raise LiveError(
                f"{robot.name}: {robot.joint_names[index]} has no {key} limit; the "
                "box's reflexes need all limits: give them in the URDF"
            )
    offset, deceleration = np.zeros(JOINTS), np.full(JOINTS, np.inf)
    elements = {
        joint.get("name"): joint.find("position_based_velocity_limits")
        for joint in read_urdf(robot.source).findall("joint")
    }
    for at, name in enumerate(robot.joint_names):
        element = elements.get(name)
        if element is not None:
            offset[at] = float(element.get("velocity_offset", "0"))
            deceleration[at] = float(element.get("deceleration_limit", "inf"))
    return ArmLimits(**limits, velocity_offset=offset, deceleration=deceleration)


def _urdf(model: pin.Model, flange: pin.SE3, limits: ArmLimits, name: str) -> str:
    """Return a description with the names and elements that libfranka expects.

    Its joints are joint1 to joint7, each with ``<position_based_velocity_limits>``, and
    its last link is link8. A name with ``tmr`` in front would be a mobile robot's.
    """
    top = ElementTree.Element("robot", name=f"box_{name}")
    ElementTree.SubElement(top, "link", name="link0")
    data = model.createData()
    pin.computeJointJacobians(model, data, pin.neutral(model))
    for index in range(1, JOINTS + 1):
        link = ElementTree.SubElement(top, "link", name=f"link{index}")
        _add_inertia(link, model.inertias[index])
        J = pin.getJointJacobian(model, data, index, pin.ReferenceFrame.LOCAL)
        joint = _add_joint(top, index, "revolute", model.jointPlacements[index])
        ElementTree.SubElement(joint, "axis", xyz=_numbers(J[3:, index - 1]))
        at = index - 1
        ElementTree.SubElement(
            joint,
            "limit",
            lower=repr(float(limits.lower[at])),
            upper=repr(float(limits.upper[at])),
            velocity=repr(float(limits.velocity[at])),
            effort=repr(float(limits.effort[at])),
        )
        ElementTree.SubElement(
            joint,
            "position_based_velocity_limits",
            velocity_offset=repr(float(limits.velocity_offset[at])),
            deceleration_limit=repr(
                float(min(limits.deceleration[at], _ANY_DECELERATION))
            ),
        )
    ElementTree.SubElement(top, "link", name=FLANGE)
    _add_joint(top, JOINTS + 1, "fixed", flange)
    return ElementTree.tostring(top, encoding="unicode")


def _add_inertia(link: ElementTree.Element, body: pin.Inertia) -> None:
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=_numbers(body.lever), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(body.mass)))
    moments = {
        f"i{'xyz'[i]}{'xyz'[j]}": repr(float(body.inertia[i, j]))
        for i in range(3)
        for j in range(i, 3)
    }
    ElementTree.SubElement(inertial, "inertia", moments)


def _add_joint(
    top: ElementTree.Element, index: int, kind: str, placement: pin.SE3
) -> ElementTree.Element:
    joint = ElementTree.SubElement(top, "joint", name=f"joint{index}", type=kind)
    ElementTree.SubElement(joint, "parent", link=f"link{index - 1}")
    ElementTree.SubElement(joint, "child", link=f"link{index}")
    angles = pin.rpy.matrixToRpy(placement.rotation)
    ElementTree.SubElement(
        joint, "origin", xyz=_numbers(placement.translation), rpy=_numbers(angles)
    )
    return joint


def _numbers(values: Array) -> str:
    return " ".join(repr(float(value)) for value in values)
