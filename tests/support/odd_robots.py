"""Robots of one odd link, written to files: boxes, cylinders, balls and meshes."""

import struct
from pathlib import Path

import numpy as np

from hsp_control import Robot
from hsp_control.common.arrays import Array

ONE_LINK = """<robot name="odd">
  <link name="base">{base}</link>
  <joint name="turn" type="revolute">
    <parent link="base"/><child link="arm"/><origin xyz="0 0 0.3"/><axis xyz="0 1 0"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <link name="arm">{inertial}{arm}</link>
  <joint name="bend" type="revolute">
    <parent link="arm"/><child link="hand"/><origin xyz="0.4 0 0"/><axis xyz="0 0 1"/>
    <limit lower="-3" upper="3" effort="1" velocity="1"/>
  </joint>
  <link name="hand">{inertial}</link>
</robot>"""
INERTIAL = (
    '<inertial><origin xyz="0.1 0.1 0"/><mass value="1"/>'
    '<inertia ixx="0.1" iyy="0.1" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>'
)


def collision(
    geometry: str, xyz: str = "0.1 0.02 -0.03", rpy: str = "0.3 -0.2 1"
) -> str:
    """Return a URDF's collision element."""
    return (
        f'<collision><origin xyz="{xyz}" rpy="{rpy}"/>'
        f"<geometry>{geometry}</geometry></collision>"
    )


def odd_robot(folder: Path, arm: str = "", base: str = "") -> Robot:
    """Return a robot of two links with the given geometry."""
    file = folder / "odd.urdf"
    file.write_text(ONE_LINK.format(base=base, arm=arm, inertial=INERTIAL))
    return Robot.load(file)


def write_stl(
    file: Path, vertices: Array, triangles: list[tuple[int, int, int]]
) -> Path:
    """Write a binary STL."""
    body = b"".join(
        struct.pack("<12fH", 0, 0, 0, *np.asarray(vertices)[list(t)].ravel(), 0)
        for t in triangles
    )
    file.write_bytes(bytes(80) + struct.pack("<I", len(triangles)) + body)
    return file


OCTAHEDRON = np.array(
    [
        [0.2, 0, 0],
        [-0.2, 0, 0],
        [0, 0.15, 0],
        [0, -0.15, 0],
        [0, 0, 0.25],
        [0, 0, -0.25],
    ]
)
FACES = [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4),
         (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)]  # fmt: skip
