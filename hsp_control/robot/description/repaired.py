"""Write a URDF with inertias that a body can have."""

import os
from pathlib import Path
from xml.etree import ElementTree

from hsp_control.common.exceptions import ModelError
from hsp_control.robot.description.inertias import project_inertias
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf_checks import named_files, read_urdf


def write_repaired(source: RobotSource, path: Path) -> Path:
    """Write a robot's URDF with projected inertias; all else stays, but comments."""
    xml = read_urdf(source)
    if path.exists() and path.samefile(source.urdf):
        raise ModelError(f"{path}: is the robot's own file; give another one")
    project_inertias(xml)
    relative = {name for name, _ in named_files(xml) if _is_relative(name)}
    for element in xml.iter():
        if element.get("filename") in relative:
            file = source.urdf.resolve().parent / element.get("filename", "")
            element.set("filename", os.path.relpath(file, path.resolve().parent))
    ElementTree.ElementTree(xml).write(path, encoding="utf-8", xml_declaration=True)
    return path


def _is_relative(name: str) -> bool:
    return "://" not in name and not Path(name).is_absolute()
