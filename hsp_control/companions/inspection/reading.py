"""How a robot's files are read where that is not obvious, and ignored elements."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from hsp_control.common.errors import ModelError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.inspection.finding import Finding
from hsp_control.robot.description.access import XmlError, read_xml
from hsp_control.robot.description.mesh_files import find_file, find_problem
from hsp_control.robot.description.mesh_units import MeshUnits, mesh_units
from hsp_control.robot.description.mimics import followers
from hsp_control.robot.description.motor_inertia import transmissions
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf import why_no_shape

_READ = {
    "robot": {"link", "joint", "material"},
    "link": {"inertial", "visual", "collision"},
    "joint": {
        "origin", "parent", "child", "axis", "limit", "mimic", "dynamics",
        "safety_controller",
    },
}  # fmt: skip
"""Elements that are read, by their parents."""
_UNREAD = {
    "transmission": "except its rotor: positions, speeds and efforts are the joints'",
    "calibration": "positions are measured from the zero of the model",
    "gazebo": "only Gazebo uses it",
}


def check_unread(xml: Element) -> Iterator[Finding]:
    """Yield the kinds of elements that are ignored."""
    found: dict[str, dict[str, None]] = {}
    for owner in (xml, *xml.findall("link"), *xml.findall("joint")):
        for element in owner:
            if element.tag not in _READ[owner.tag]:
                name = (element if owner is xml else owner).get("name")
                name = name or element.get("reference") or ""
                found.setdefault(element.tag, {})[name] = None
    for tag, owners in found.items():
        about = listing([repr(name) for name in owners if name]) or "the robot"
        message = f"of {about} is not read"
        if tag in _UNREAD:
            message += f": {_UNREAD[tag]}"
        yield Finding("note", "not read", f"<{tag}>", message)


def check_transmissions(xml: Element) -> Iterator[Finding]:
    """Yield transmissions of joints that do not exist, and joints with several."""
    joints = [joint.get("name", "") for joint in xml.findall("joint")]
    for joint, names in transmissions(xml).items():
        about = f"transmission {listing(map(repr, names))}"
        if joint not in joints:
            yield Finding(
                "warning",
                "transmission",
                about,
                f"its joint {joint!r} does not exist{did_you_mean(joint, joints)}",
                "correct the name: its rotor is assigned to no joint",
            )
        elif len(names) > 1:
            yield Finding(
                "warning",
                "transmission",
                about,
                f"all are of joint {joint!r}: the last one's rotor is used",
                "keep one of them",
            )


def check_followers(xml: Element) -> Iterator[Finding]:
    """Yield the followers whose limits bound their leaders, or cannot be met."""
    joints = {each.get("name", ""): each for each in xml.findall("joint")}
    try:
        found = followers(xml)
    except ModelError as error:
        yield Finding("error", "mimic", "joints", str(error))
        return
    for each in found:
        if each.multiplier == 0.0:
            continue
        try:
            lower, upper = each.leaders_range(joints)
            low, high = each.bounds(joints[each.name])
        except ModelError:
            continue  # `check_limits` reports it
        name = f"joint {each.name!r}"
        if max(lower, low) >= min(upper, high):
            message = (
                f"its limits allow its leader {each.leader!r} to be from {low:.4g} to "
                f"{high:.4g}, whose own are {lower:.4g} to {upper:.4g}: the "
                "follower's limits are ignored"
            )
            yield Finding("warning", "mimic", name, message, "correct one of them")
        elif low > lower + 1e-6 or high < upper - 1e-6:
            message = (
                f"its limits keep its leader {each.leader!r} within "
                f"{max(low, lower):.4g} to {min(high, upper):.4g}"
            )
            yield Finding("note", "mimic", name, message)


def check_soft_limits(xml: Element) -> Iterator[Finding]:
    """Yield the joints whose soft limits are narrower than their limits."""
    for joint in xml.findall("joint"):
        limit, safety = joint.find("limit"), joint.find("safety_controller")
        if limit is None or safety is None or joint.get("type") == "continuous":
            continue
        low, high = (float(safety.get(f"soft_{x}_limit", 0.0)) for x in _ENDS)
        lower, upper = (float(limit.get(x, 0.0)) for x in _ENDS)
        if low < high and (low > lower or high < upper):
            message = (
                f"its soft limits keep it within {max(low, lower):.4g} to "
                f"{min(high, upper):.4g} of {lower:.4g} to {upper:.4g}"
            )
            name = f"joint {joint.get('name', '')!r}"
            yield Finding("note", "soft limits", name, message)


_ENDS = "lower", "upper"
_SOFT_ENDS = "soft_lower_limit", "soft_upper_limit"


def check_continuous(xml: Element) -> Iterator[Finding]:
    """Yield the continuous joints with limits of their position."""
    given = (
        ("limit", _ENDS, "limit", "limits"),
        ("safety_controller", _SOFT_ENDS, "soft limits", "soft limits"),
    )
    for joint in xml.findall("joint"):
        if joint.get("type") != "continuous":
            continue
        for tag, names, check, what in given:
            element = joint.find(tag)
            low, high = (_number(element, name) for name in names)
            if low != high:
                yield Finding(
                    "note",
                    check,
                    f"joint {joint.get('name', '')!r}",
                    f"its {what} {low:g} to {high:g} are not used: it is continuous",
                    "if it has limits, give it type revolute",
                )


def _number(element: Element | None, name: str) -> float:
    return 0.0 if element is None else float(element.get(name, 0.0))


def check_friction(xml: Element) -> Iterator[Finding]:
    """Yield the joints whose damping or friction is negative."""
    for joint in xml.findall("joint"):
        for name in ("damping", "friction"):
            value = _number(joint.find("dynamics"), name)
            if value < 0.0:
                yield Finding(
                    "warning",
                    "dynamics",
                    f"joint {joint.get('name', '')!r}",
                    f"its {name} {value:g} is negative, as of a joint that gains "
                    f"energy: {-value:g} is used",
                    "give it without the sign",
                )


def check_planar_axes(xml: Element) -> Iterator[Finding]:
    """Yield the planar joints without a declared plane."""
    for joint in xml.findall("joint"):
        if joint.get("type") == "planar" and joint.find("axis") is None:
            yield Finding(
                "note",
                "axis",
                f"joint {joint.get('name', '')!r}",
                "planar without <axis>: its plane is x-y, where URDF's own default "
                "would be y-z",
                'give <axis xyz="0 0 1"/>',
            )


def check_mesh_axes(xml: Element, source: RobotSource) -> Iterator[Finding]:
    """Yield the mesh files in which another axis than z points up."""
    turned: dict[str, dict[str, None]] = {}
    for link in xml.findall("link"):
        for mesh in link.iter("mesh"):
            file = find_file(source, mesh.get("filename", ""))
            if file is None or find_problem(file):
                continue
            if (up := mesh_units(file).up) != MeshUnits().up:
                turned.setdefault(up, {})[link.get("name", "")] = None
    for up, links in turned.items():
        axis = up[0].lower()
        yield Finding(
            "note",
            "mesh",
            f"meshes of {listing(links)}",
            f"their files declare {axis} as the up axis: it is turned to the link's z, "
            "unlike in RViz",
            "if the robot looks wrong, write <up_axis>Z_UP",
        )


def check_shapes(xml: Element) -> Iterator[Finding]:
    """Yield the links with collision shapes that parsers refuse."""
    for link in xml.findall("link"):
        for element in link.findall("collision"):
            if why := why_no_shape(element):
                yield Finding(
                    "warning",
                    "shape",
                    f"link {link.get('name', '')!r}",
                    f"a collision shape: {why}",
                    "distances leave out this shape: give the link another one",
                )


def check_srdf(xml: Element, source: RobotSource) -> Iterator[Finding]:
    """Yield that an SRDF cannot be read, or names links that do not exist."""
    if source.srdf is None:
        return
    try:
        srdf = read_xml(source.srdf)
    except XmlError as error:
        yield Finding("error", "srdf", str(source.srdf), error.message)
        return
    except OSError as error:
        yield Finding("error", "srdf", str(source.srdf), str(error.strerror))
        return
    links = [link.get("name", "") for link in xml.findall("link")]
    unknown: dict[str, None] = {}
    ends = {
        "disable_collisions": ("link1", "link2"),
        "enable_collisions": ("link1", "link2"),
        "disable_default_collisions": ("link",),
    }
    unknown = {
        name: None
        for tag, attributes in ends.items()
        for element in srdf.iter(tag)
        for attribute in attributes
        if (name := element.get(attribute, "")) not in links
    }
    if unknown:
        first, *others = unknown
        named = f"{first!r}{did_you_mean(first, links)}"
        named += f" and {len(others)} more" * bool(others)
        message = f"it names links that do not exist: {named}"
        yield Finding("note", "srdf", source.srdf.name, message)
