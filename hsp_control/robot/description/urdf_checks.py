"""What a URDF must be before other people's parsers see it: numbers, names, sizes.

They take NaN for a mass, abort on some numbers, and know no bounds. What they refuse
themselves, in their own words, is left to them.
"""

import math
from collections.abc import Iterator
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

from hsp_control.common.exceptions import ModelError, RobotNotFoundError
from hsp_control.robot.description.xml_files import XmlError, read_xml

MAX_LINKS = 1000
"""Links of a robot: recursions grow with them."""
MAX_DOFS = 200
"""Joints that move: Pinocchio's memory and time grow with their cube."""
MAX_NUMBER = 1e9
"""The largest length, angle, mass or inertia in a URDF, in SI units."""

_NUMBERS = {
    "origin": {"xyz": 3, "rpy": 3},
    "mass": {"value": 1},
    "inertia": dict.fromkeys(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), 1),
    "axis": {"xyz": 3},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "dynamics": {"damping": 1, "friction": 1},
    "color": {"rgba": 4},
}
_LIMITS = {"limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1)}
"""Where any size is a limit, or says that there is none."""
_LENGTHS = {"box", "cylinder", "capsule", "sphere"}
_TURNING = {"revolute", "continuous", "prismatic"}
_INDEFINITE = 1e-6
"""How negative a moment of inertia may be [kg·m²]: real files are rounded or guessed,
and the mass matrix is checked later."""


def read_urdf(urdf: Path) -> Element:
    """Return the top element of a URDF that can be given to any parser.

    Raises:
        RobotNotFoundError: If it cannot be read.
        ModelError: If it is not XML, not a robot, too large, or holds a number that no
            robot has; the message says where.
    """
    try:
        robot = read_xml(urdf)
    except ElementTree.ParseError as error:
        line, column = error.position
        raise ModelError(
            f"{urdf}:{line}:{column + 1}: malformed XML: {error}"
        ) from error
    except XmlError as error:
        where = f"{urdf}:{error.line}" if error.line else f"{urdf}"
        raise ModelError(f"{where}: {error.message}") from None
    except OSError as error:
        raise RobotNotFoundError(f"{urdf}: {error.strerror}") from error
    except (LookupError, ValueError) as error:  # an encoding that nobody knows
        raise ModelError(f"{urdf}: malformed XML: {error}") from error
    if robot.tag != "robot":
        raise ModelError(
            f"{urdf}: the top element is <{robot.tag}>, a URDF's is <robot>"
        )
    count = sum(1 for _ in robot.iter("link"))
    if count > MAX_LINKS:
        raise ModelError(f"{urdf}: {count} links; at most {MAX_LINKS}")
    count = sum(joint.get("type") != "fixed" for joint in robot.iter("joint"))
    if count > MAX_DOFS:
        raise ModelError(f"{urdf}: {count} joints that move; at most {MAX_DOFS}")
    for owner, element in _owned(robot):
        complaint = _complaint(element)
        if complaint:
            raise ModelError(f"{urdf}: {owner}<{element.tag}>: {complaint}")
    return robot


def named_files(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield every file that a URDF names, and which element of what names it."""
    for owner, element in _owned(robot):
        name = element.get("filename")
        if name is not None:
            yield name, f"{owner}<{element.tag}>"


def _owned(robot: Element) -> Iterator[tuple[str, Element]]:
    """Yield all elements, each with the link, joint or material that it is of."""
    for child in robot:
        name = child.get("name")
        owner = f"{child.tag} {name!r}: " if name else ""
        for element in child.iter():
            yield owner, element


def _complaint(element: Element) -> str:
    """Return what is wrong with an element, or nothing."""
    tag = element.tag
    for name, count in _NUMBERS.get(tag, {}).items():
        text = element.get(name)
        if text is not None and (wrong := _wrong_numbers(text, count, MAX_NUMBER)):
            return f'{name}="{_short(text)}" {wrong}'
    for name, count in _LIMITS.get(tag, {}).items():
        text = element.get(name)
        if text is not None and (wrong := _wrong_numbers(text, count, math.inf)):
            return f'{name}="{_short(text)}" {wrong}'
    if tag == "mass" and float(element.get("value", 0.0)) < 0.0:
        return f'value="{element.get("value")}": a mass is not negative'
    if tag == "inertia":
        least = float(np.linalg.eigvalsh(_tensor(element))[0])
        if least < -_INDEFINITE:
            return f"a principal moment of {least:.3g} kg·m²: none is negative"
    if tag == "joint" and element.get("type") in _TURNING:
        axis = element.find("axis")
        direction = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if not _wrong_numbers(direction, 3, MAX_NUMBER) and not any(_parsed(direction)):
            return f'axis xyz="{direction}" has no direction'
    if tag in _LENGTHS and any(
        length < 0.0
        for name in _NUMBERS[tag]
        for length in _parsed(element.get(name, ""))
    ):
        return "a negative length"
    if tag == "mesh" and not (element.get("filename") or "").strip():
        return "names no file (filename)"
    return ""


def _wrong_numbers(text: str, count: int, largest: float) -> str:
    try:
        numbers = _parsed(text)
    except ValueError:
        return f"is not {count} number{'s' if count > 1 else ''}"
    if len(numbers) != count:
        return f"is not {count} number{'s' if count > 1 else ''}"
    if not all(map(math.isfinite, numbers)):
        return "is not finite"
    if max(map(abs, numbers)) > largest:
        return f"is beyond {largest:g}, no number of a robot"
    return ""


def _parsed(text: str) -> list[float]:
    if "_" in text:  # Python's own digit grouping is nobody else's
        raise ValueError(text)
    return [float(word) for word in text.split()]


def _tensor(element: Element) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = (
        float(element.get(name, 0.0)) for name in _NUMBERS["inertia"]
    )
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
