"""Check the numbers and the size of a URDF before other parsers read it.

These parsers accept NaN as a mass, abort the process on some numbers, and do not limit
the size. Faults that they detect and report themselves are left to them.
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
"""Maximum number of links: the depth of recursions grows with it."""
MAX_DOFS = 200
"""Maximum number of moving joints.

Pinocchio's memory and time grow with its cube.
"""
MAX_NUMBER = 1e9
"""Maximum absolute value of lengths, angles, masses and inertias, in SI units."""

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
"""Attributes that may be arbitrarily large: very large limits mean no limit."""
_LENGTHS = {"box", "cylinder", "capsule", "sphere"}
_WITH_AXIS = {"revolute", "continuous", "prismatic"}
_INERTIA_TOLERANCE = 1e-6
"""A principal moment of inertia may be negative by this much [kg·m²].

Many files contain rounded or guessed inertias; the mass matrix is checked later.
"""


def read_urdf(urdf: Path) -> Element:
    """Return the top element of a URDF that is safe to pass to any parser.

    Raises:
        RobotNotFoundError: If the file cannot be read.
        ModelError: If the file is not XML, not a URDF, too large, or contains an
            invalid number; the message says where.
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
    except (LookupError, ValueError) as error:  # an unknown encoding
        raise ModelError(f"{urdf}: malformed XML: {error}") from error
    if robot.tag != "robot":
        hint = "; give an MJCF as mjcf, not as name" if robot.tag == "mujoco" else ""
        raise ModelError(
            f"{urdf}: the top element is <{robot.tag}>; in a URDF it is <robot>{hint}"
        )
    count = sum(1 for _ in robot.iter("link"))
    if count > MAX_LINKS:
        raise ModelError(f"{urdf}: {count} links; at most {MAX_LINKS}")
    count = sum(joint.get("type") != "fixed" for joint in robot.iter("joint"))
    if count > MAX_DOFS:
        raise ModelError(f"{urdf}: {count} moving joints; at most {MAX_DOFS}")
    for owner, element in _elements(robot):
        problem = _find_problem(element)
        if problem:
            raise ModelError(f"{urdf}: {owner}<{element.tag}>: {problem}")
    return robot


def named_files(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield every file name in a URDF, with the element that contains it.

    For example ``("hand.stl", "link 'hand': <mesh>")``.
    """
    for owner, element in _elements(robot):
        name = element.get("filename")
        if name is not None:
            yield name, f"{owner}<{element.tag}>"


def _elements(robot: Element) -> Iterator[tuple[str, Element]]:
    """Yield the link, joint or material that an element is in, and the element."""
    for child in robot:
        name = child.get("name")
        owner = f"{child.tag} {name!r}: " if name else ""
        for element in child.iter():
            yield owner, element


def _find_problem(element: Element) -> str:
    """Return what is wrong with an element, or an empty string."""
    tag = element.tag
    for name, count in _NUMBERS.get(tag, {}).items():
        text = element.get(name)
        if text is not None and (wrong := _check_numbers(text, count, MAX_NUMBER)):
            return f'{name}="{_short(text)}" {wrong}'
    for name, count in _LIMITS.get(tag, {}).items():
        text = element.get(name)
        if text is not None and (wrong := _check_numbers(text, count, math.inf)):
            return f'{name}="{_short(text)}" {wrong}'
    if tag == "mass" and float(element.get("value", 0.0)) < 0.0:
        return f'value="{element.get("value")}": a mass must not be negative'
    if tag == "inertia":
        smallest = float(np.linalg.eigvalsh(_tensor(element))[0])
        if smallest < -_INERTIA_TOLERANCE:
            return f"a principal moment is {smallest:.3g} kg·m²; must not be negative"
    if tag == "joint" and element.get("type") in _WITH_AXIS:
        axis = element.find("axis")
        direction = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if not _check_numbers(direction, 3, MAX_NUMBER) and not any(_parsed(direction)):
            return f'axis xyz="{direction}" must not be zero'
    for name in _NUMBERS[tag] if tag in _LENGTHS else ():
        text = element.get(name, "")
        if any(length < 0.0 for length in _parsed(text)):
            return f'{name}="{_short(text)}" must not be negative'
    if tag == "mesh" and not (element.get("filename") or "").strip():
        return "the filename is missing"
    return ""


def _check_numbers(text: str, count: int, largest: float) -> str:
    """Return what is wrong with an attribute of some numbers, or an empty string."""
    needed = f"must be {count} numbers" if count > 1 else "must be a number"
    try:
        numbers = _parsed(text)
    except ValueError:
        return needed
    if len(numbers) != count:
        return needed
    if not all(map(math.isfinite, numbers)):
        return "is not finite"
    if max(map(abs, numbers)) > largest:
        return f"is too large; at most {largest:g} (SI units)"
    return ""


def _parsed(text: str) -> list[float]:
    if "_" in text:  # Python accepts 1_000, other parsers do not
        raise ValueError(text)
    return [float(word) for word in text.split()]


def _tensor(element: Element) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = (
        float(element.get(name, 0.0)) for name in _NUMBERS["inertia"]
    )
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
