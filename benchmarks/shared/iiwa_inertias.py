"""The bundled iiwa with the inertias of another public source.

The numbers are column D of robots/iiwa14/README.md, R. Krug's lbr_iiwa (also in
iiwa_stack and bullet3): masses, centres of mass and moments of inertia in the axes of
the base at q = 0. Gravity torques and mass matrix differ by a third from the bundled
ones, which are Drake's.
"""

import xml.etree.ElementTree as ET
from pathlib import Path

import numpy as np
import pinocchio as pin

from hsp_control import Robot

LBR_IIWA = {
    1: (4.0, (0, -30, 277), (100.0, 90.0, 20.0)),
    2: (4.0, (0, 42, 419), (50.0, 44.0, 18.0)),
    3: (3.0, (0, 30, 694), (80.0, 75.0, 10.0)),
    4: (2.7, (0, -34, 847), (30.0, 29.0, 10.0)),
    5: (1.7, (0, -21, 1040), (20.0, 18.0, 5.0)),
    6: (1.8, (0, 0, 1181), (5.0, 4.7, 3.6)),
    7: (0.3, (0, 0, 1281), (1.0, 1.0, 1.0)),
}
"""By link: mass [kg], centre of mass [mm], moments of inertia about it [g m²]."""


def write_urdf(folder: Path) -> Path:
    """Write the bundled URDF with these inertias into a folder; return the file."""
    robot = Robot.load("iiwa14")
    data = robot.model.createData()
    pin.forwardKinematics(robot.model, data, robot.neutral())
    tree = ET.parse(robot.source.urdf)
    for link, (mass, center, moments) in LBR_IIWA.items():
        joint = data.oMi[robot.model.getJointId(f"iiwa_joint_{link}")]
        lever = joint.actInv(1e-3 * np.array(center, dtype=float))
        inertia = joint.rotation.T @ np.diag(1e-3 * np.array(moments)) @ joint.rotation
        inertial = tree.find(f"./link[@name='iiwa_link_{link}']/inertial")
        assert inertial is not None
        inertial.clear()
        ET.SubElement(inertial, "origin", xyz=" ".join(f"{x:.9g}" for x in lever))
        ET.SubElement(inertial, "mass", value=f"{mass:.9g}")
        entries = {
            f"i{'xyz'[i]}{'xyz'[j]}": f"{inertia[i, j]:.9g}"
            for i in range(3)
            for j in range(i, 3)
        }
        ET.SubElement(inertial, "inertia", entries)
    file = folder / "iiwa14_lbr_iiwa.urdf"
    tree.write(file)
    return file
