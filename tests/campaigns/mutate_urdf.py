"""Invalid URDFs: wrong bytes, structure, numbers and files."""

import copy
from random import Random
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

from campaigns.texts import TRICKS

NUMBERS = [
    "nan", "inf", "-inf", "1e308", "-1e308", "1e-308", "1e400", "0", "-1", "1e9", "1e6",
    "", " ", "x", "1,5", "0x10", "1_000", "1 2", "1 2 3 4", "0 0 0", "1e-12", "١",
]  # fmt: skip
NAMES = [
    *("", " ", "world", "universe", "root_joint", "x" * 5000),
    *("a b", "é", "..", "/", "\u202e"),
]
FILES = [
    "", "nowhere.stl", "/etc/passwd", "../../../../etc/passwd", "package://", "package://../x",
    "file:///etc/passwd", "http://127.0.0.1/x.stl", "/dev/zero", "/", ".",
    "bad.stl", "bad.obj",
    "bad.dae", "laughs.dae", "x" * 5000, "package://panda/../../../../etc/passwd",
    "pipe.stl",
]  # fmt: skip
KINDS = [
    *("revolute", "continuous", "prismatic", "fixed"),
    *("floating", "planar", "spherical", ""),
]

LAUGHS = (
    '<?xml version="1.0"?>\n<!DOCTYPE lolz [<!ENTITY a0 "lol">'
    + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 10))
    + "]>\n"
)
EXTERNAL = (
    '<?xml version="1.0"?>\n<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">'
    '<!ENTITY % p SYSTEM "http://127.0.0.1:9/x.dtd"> %p;]>\n'
)

ARM = """<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <inertial><origin xyz="0 0 0.2"/><mass value="2"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual><geometry><cylinder radius="0.05" length="0.4"/></geometry>
      <material name="red"><color rgba="1 0 0 1"/></material></visual>
    <collision><origin xyz="0 0 0.2" rpy="0 0 0"/>
      <geometry><mesh filename="good.stl" scale="1 1 1"/></geometry></collision>
  </link>
  <link name="lower">
    <inertial><origin xyz="0 0 0.2"/><mass value="1"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
    <visual><geometry><box size="0.1 0.1 0.4"/></geometry></visual>
    <collision><geometry><sphere radius="0.1"/></geometry></collision>
  </link>
  <link name="hand">
    <inertial><origin xyz="0 0 0.1"/><mass value="0.5"/>
      <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial>
    <collision><geometry><box size="0.1 0.1 0.1"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute"><parent link="base"/><child link="upper"/>
    <origin xyz="0 0 0.1" rpy="0 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="90" velocity="9"/>
    <dynamics damping="0.1" friction="0.2"/></joint>
  <joint name="elbow" type="continuous"><parent link="upper"/><child link="lower"/>
    <origin xyz="0 0 0.4" rpy="0.1 0 0"/><axis xyz="1 0 0"/>
    <limit effort="90" velocity="9"/></joint>
  <joint name="wrist" type="prismatic"><parent link="lower"/><child link="hand"/>
    <origin xyz="0 0 0.4" rpy="0 0.2 0"/><axis xyz="0 0 1"/>
    <limit lower="-0.2" upper="0.2" effort="90" velocity="1"/></joint>
</robot>
"""
"""A small robot with every element; others are bundled."""


def mutated(data: bytes, random: Random) -> bytes:
    """Return a mutated URDF."""
    trick = random.random()
    if trick < 0.2:
        return random.choice(TRICKS)(data, random)
    if trick < 0.25:
        head = random.choice((LAUGHS, EXTERNAL))
        body = data.decode().partition("?>")[2] or data.decode()
        name = random.choice(("&a9;", "&x;", "&lt;", "panda"))
        return (head + body.replace('"panda"', f'"{name}"', 1)).encode()
    root = ElementTree.fromstring(data)
    for _ in range(random.choice((1, 1, 1, 2, 3))):
        _change(root, random)
    text = ElementTree.tostring(root)
    for count in (50, 150, 300, 3000):  # deeper than Python itself can write
        nested = b"<x>" * count + b"</x>" * count
        text = text.replace(f"<deep{count} />".encode(), nested)
    return text


def _change(root: Element, random: Random) -> None:
    elements = list(root.iter())
    element = random.choice(elements)
    parents = {child: parent for parent in elements for child in parent}
    match random.randrange(12):
        case 0 | 1 | 2 | 3:
            with_numbers = [
                e for e in elements if e.tag in ("origin", "mass", "inertia",
                "limit", "axis",
                "box", "sphere", "cylinder", "mesh", "color", "mimic", "dynamics")
            ]  # fmt: skip
            chosen = random.choice(with_numbers or elements)
            if chosen.attrib:
                key = random.choice(list(chosen.attrib))
                chosen.set(key, _number(chosen.get(key, ""), random))
        case 4 if element is not root:
            parents[element].remove(element)
        case 5 if element is not root:
            parents[element].append(copy.deepcopy(element))
        case 6:
            random.choice(elements).append(
                copy.deepcopy(random.choice(elements[1:] or [root]))
            )
        case 7:
            joints = list(root.iter("joint"))
            if joints:
                random.choice(joints).set("type", random.choice(KINDS))
        case 8:
            named = [e for e in elements if "link" in e.attrib or "name" in e.attrib]
            if named:
                one, other = random.choice(named), random.choice(named)
                key = "link" if "link" in one.attrib else "name"
                name = other.get("link") or other.get("name") or ""
                one.set(key, random.choice((name, random.choice(NAMES))))
        case 9:
            meshes = list(root.iter("mesh"))
            if meshes:
                random.choice(meshes).set("filename", random.choice(FILES))
            else:
                for geometry in root.iter("geometry"):
                    geometry.clear()
                    geometry.append(Element("mesh", filename=random.choice(FILES)))
        case 10:
            _grow(root, random)
        case _:
            element.tag = random.choice(
                ("link", "joint", "nonsense", "robot", "mesh", "x")
            )


def _number(text: str, random: Random) -> str:
    words = text.split()
    if not words or random.random() < 0.3:
        return random.choice(NUMBERS)
    words[random.randrange(len(words))] = random.choice(NUMBERS)
    return " ".join(words)


def _grow(root: Element, random: Random) -> None:
    """Make it deeply nested, long or wide."""
    count = random.choice((50, 150, 300, 3000))
    kind = random.choice(("deep", "chain", "materials"))
    if kind == "deep":
        root.append(Element(f"deep{count}"))
    elif kind == "materials":
        root.extend([Element("material", name=f"m{k}") for k in range(count)])
    else:
        links = [link.get("name", "") for link in root.iter("link")]
        before = random.choice(links or [""])
        for k in range(count):
            root.append(ElementTree.fromstring(_link(k)))
            root.append(ElementTree.fromstring(_joint(k, before)))
            before = f"more{k}"


def _link(k: int) -> str:
    return (
        f'<link name="more{k}"><inertial><mass value="0.1"/>'
        '<inertia ixx="0.01" ixy="0" '
        'ixz="0" iyy="0.01" iyz="0" izz="0.01"/></inertial></link>'
    )


def _joint(k: int, parent: str) -> str:
    return (
        f'<joint name="mj{k}" type="revolute"><parent link="{parent}"/>'
        f'<child link="more{k}"/><origin xyz="0 0 0.1"/><axis xyz="0 1 0"/>'
        '<limit lower="-1" upper="1" effort="9" velocity="9"/></joint>'
    )
