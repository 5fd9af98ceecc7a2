"""Read a URDF, with its numbers and its size checked before other parsers read it.

These parsers accept NaN as a mass, abort the process on some numbers, and do not limit
the size. Faults that they detect and report themselves are left to them.
"""

import math
from collections import Counter
from collections.abc import Iterator
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from hsp_control.common.errors import ModelError, RobotNotFoundError
from hsp_control.common.suggestions import listing
from hsp_control.robot.description.access import XmlError, parse_xml, read_xml
from hsp_control.robot.description.inertias import ENTRIES
from hsp_control.robot.description.sources import PINOCCHIO, RobotSource

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
    "inertia": dict.fromkeys(ENTRIES, 1),
    "axis": {"xyz": 3},
    "mimic": {"multiplier": 1, "offset": 1},
    "box": {"size": 3},
    "cylinder": {"radius": 1, "length": 1},
    "capsule": {"radius": 1, "length": 1},
    "sphere": {"radius": 1},
    "mesh": {"scale": 3},
    "dynamics": {"damping": 1, "friction": 1},
    "color": {"rgba": 4},
    "safety_controller": dict.fromkeys(
        ("soft_lower_limit", "soft_upper_limit", "k_position", "k_velocity"), 1
    ),
    "limit": dict.fromkeys(("lower", "upper", "effort", "velocity"), 1),
}
"""How many numbers an element's attributes are."""
_LENGTHS = {"box", "cylinder", "capsule", "sphere"}
_SHAPES = {
    "box": {"size"},
    "cylinder": {"radius", "length"},
    "capsule": {"radius", "length"},
    "sphere": {"radius"},
    "mesh": {"filename"},
}
"""The shapes that a URDF can have, and the attributes that each needs."""
_SINGLE = {
    "link": {"inertial"},
    "inertial": {"origin", "mass", "inertia"},
    "visual": {"origin", "geometry"},
    "collision": {"origin", "geometry"},
    "geometry": set(_SHAPES),
    "joint": {
        "origin",
        "parent",
        "child",
        "axis",
        "limit",
        "mimic",
        "dynamics",
        "safety_controller",
    },
}
"""Elements that others may contain once; parsers silently use one of several."""
_OF_MJCF = "; an MJCF's robot is robot: {mjcf: FILE} in a configuration"
_WITH_AXIS = {"revolute", "continuous", "prismatic", "planar"}


def read_urdf(source: RobotSource) -> Element:
    """Return the top element of a URDF that any parser can read."""
    robot = parse_urdf(source)
    for where, problem in problems(robot):
        raise ModelError(f"{source.urdf}: {where}: {problem}")
    for element in robot.iter():
        for name in _NUMBERS.get(element.tag, ()):
            if (text := element.get(name)) is not None:
                element.set(name, _plain(text))
    return robot


def parse_urdf(source: RobotSource) -> Element:
    """Return the top element of a URDF whose elements are not yet checked."""
    urdf = source.urdf
    if source.origin == PINOCCHIO:
        raise ModelError(
            f"{source.name} was made of a pinocchio.Model, and its URDF is needed: "
            "load it with Robot.load"
        )
    try:
        if source.expanded is None:
            robot = read_xml(urdf)
        else:
            robot = parse_xml(source.expanded.encode())
    except XmlError as error:
        raise ModelError(error.within(urdf)) from None
    except OSError as error:
        raise RobotNotFoundError(f"{urdf}: {error.strerror}") from error
    if robot.tag != "robot":
        hint = _OF_MJCF if robot.tag == "mujoco" else ""
        raise ModelError(
            f"{urdf}: the top element is <{robot.tag}>; in a URDF it is <robot>{hint}"
        )
    count = sum(1 for _ in robot.iter("link"))
    if count > MAX_LINKS:
        raise ModelError(f"{urdf}: {count} links; at most {MAX_LINKS}")
    count = sum(joint.get("type") != "fixed" for joint in robot.findall("joint"))
    if count > MAX_DOFS:
        raise ModelError(f"{urdf}: {count} moving joints; at most {MAX_DOFS}")
    return robot


def problems(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield everything that is wrong with a URDF's elements, with the place."""
    for owner, element in _elements(robot):
        if problem := _find_problem(element):
            yield f"{owner}<{element.tag}>", problem
    for kind in ("link", "joint"):
        names = Counter(element.get("name") for element in robot.findall(kind))
        for name, count in names.items():
            if name is not None and count > 1:
                yield f"{kind} {name!r}", f"{count} {kind}s have this name"
        for part in robot.findall(kind):
            for element in part.iter():
                if problem := _repeated(element):
                    name = part.get("name", "")
                    yield f"{kind} {name!r}: <{element.tag}>", problem
    yield from _hidden(robot)
    yield from _no_tree(robot)


def _hidden(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield the links and joints in places that parsers ignore."""
    for child in robot:
        if child.tag == "gazebo":
            continue
        found = [each for each in child.iter("joint") if each is not child]
        found = [each for each in found if each.find("parent[@link]") is not None]
        kind = child.tag.rpartition("}")[2].lower()
        if kind in ("link", "joint") and child.tag != kind:
            found.append(child)
        for each in found:
            kind, name = each.tag.rpartition("}")[2].lower(), each.get("name", "")
            within = "" if each is child else f" in <{child.tag}>"
            message = f"parsers skip <{each.tag}>{within}; must be <{kind}> in <robot>"
            yield f"{kind} {name!r}", message


def _no_tree(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield why the links are no tree; parsers then silently drop a part."""
    links = [link.get("name") for link in robot.findall("link")]
    above: dict[str | None, tuple[str, str | None]] = {}  # its joint, and parent link
    for joint in robot.findall("joint"):
        ends = [joint.find("parent"), joint.find("child")]
        parent, child = (None if end is None else end.get("link") for end in ends)
        if parent not in links or child not in links:
            return  # the parser reports it
        name = joint.get("name", "")
        if child in above:
            joints = f"the joints {above[child][0]!r} and {name!r}"
            yield f"link {child!r}", f"it is the child of {joints}; must be of one"
        else:
            above[child] = name, parent
    roots = [repr(link) for link in links if link not in above]
    if len(roots) > 1:
        message = "none is the child of a joint; a robot has one such link, its root"
        yield f"links {listing(roots)}", message
    rooted: set[str | None] = set()
    for link in links:
        way: dict[str | None, str] = {}  # the joints from a link to the root
        while link in above and link not in rooted and link not in way:
            way[link], link = above[link]
        if link in way:
            loop = [*way][[*way].index(link) :]
            names = listing(repr(way[each]) for each in loop)
            yield (
                f"links {listing(map(repr, loop))}",
                f"their joints {names} make a loop",
            )
        rooted |= way.keys()


def named_files(robot: Element) -> Iterator[tuple[str, str]]:
    """Yield every file name in a URDF, with the element that contains it."""
    for owner, element in _elements(robot):
        name = element.get("filename")
        if name is not None:
            yield name, f"{owner}<{element.tag}>"


def why_no_shape(element: Element) -> str:
    """Return why parsers refuse a link's shape, or an empty string.

    With it they refuse all other shapes of that use of the link.
    """
    shape = element.find("geometry/*")
    if shape is None:
        return "a shape without geometry"
    if shape.tag not in _SHAPES:
        return f"<{shape.tag}> is none of {listing(f'<{tag}>' for tag in _SHAPES)}"
    missing = sorted(_SHAPES[shape.tag].difference(shape.keys()))
    return f"<{shape.tag}> without {' and '.join(missing)}" if missing else ""


def admit_capsules(xml: Element) -> None:
    """Let parsers accept a URDF's capsules, which those of version 1.0 have not."""
    if xml.get("version", "1.0") in ("1", "1.0") and xml.find(".//capsule") is not None:
        xml.set("version", "1.1")


def parser_text(xml: Element, *unused: str) -> str:
    """Return a URDF's text for the parser, without ``unused`` elements of links."""
    for link in xml.iter("link"):
        for element in [each for each in link if each.tag in unused]:
            link.remove(element)
    return ElementTree.tostring(xml, encoding="unicode")


def _elements(robot: Element) -> Iterator[tuple[str, Element]]:
    """Yield the link, joint or material that an element is in, and the element."""
    for child in robot:
        name = child.get("name")
        owner = f"{child.tag} {name!r}: " if name else ""
        for element in child.iter():
            yield owner, element


def _find_problem(element: Element) -> str:
    """Return the error of an element, or an empty string."""
    tag = element.tag
    largest = math.inf if tag == "limit" else MAX_NUMBER  # large limits mean none
    for name, count in _NUMBERS.get(tag, {}).items():
        text = element.get(name)
        if text is not None and (wrong := _check_numbers(text, count, largest)):
            return f'{name}="{_short(text)}" {wrong}'
    if tag == "mass" and float(element.get("value", 0.0)) < 0.0:
        return f'value="{element.get("value")}": a mass must not be negative'
    if tag == "joint" and element.get("type") in _WITH_AXIS:
        axis = element.find("axis")
        direction = "1 0 0" if axis is None else axis.get("xyz", "1 0 0")
        if not _check_numbers(direction, 3, MAX_NUMBER) and not any(_parsed(direction)):
            return f'axis xyz="{direction}" must not be zero'
    for name in _NUMBERS[tag] if tag in _LENGTHS else ():
        text = element.get(name, "")
        if any(length < 0.0 for length in _parsed(text)):
            return f'{name}="{_short(text)}" must not be negative'
    scale = element.get("scale", "1")
    if tag == "mesh" and not all(_parsed(scale)):
        return f'scale="{_short(scale)}": a factor must not be zero'
    if tag == "safety_controller" and element.get("k_velocity") is None:
        return "the k_velocity is missing, which parsers need"
    if tag == "mesh" and not (element.get("filename") or "").strip():
        return "the filename is missing"
    return ""


def _repeated(element: Element) -> str:
    """Return the error of a repeated child of an element, or an empty string."""
    single = _SINGLE.get(element.tag, ())
    found = Counter(child.tag for child in element if child.tag in single)
    if element.tag == "geometry" and found.total() > 1:
        return f"contains {listing(found.elements())}; must be one shape"
    for tag, count in found.items():
        if count > 1:
            return f"contains {count} elements <{tag}>; must be one"
    return ""


def _check_numbers(text: str, count: int, largest: float) -> str:
    """Return the error of an attribute of some numbers, or an empty string."""
    needed = f"must be {count} numbers" if count > 1 else "must be a number"
    if not text.isascii():  # Python reads the digits of all scripts, parsers do not
        return f"{needed} in the digits 0 to 9"
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


def _plain(text: str) -> str:
    """Return numbers with one space, none subnormal: a parser drops such an inertia."""
    words = text.split()
    return " ".join("0" if 0.0 < abs(float(word)) < 1e-300 else word for word in words)


def _short(text: str) -> str:
    return text if len(text) <= 40 else f"{text[:37]}..."
