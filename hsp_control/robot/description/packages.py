"""Find ROS packages, without ROS: the folders that ``package://`` and $(find) mean."""

import os
from collections.abc import Iterable
from pathlib import Path

from hsp_control.robot.description.xml_files import XmlError, read_xml


def package_folders(package: str, folders: Iterable[Path]) -> list[Path]:
    """Return the folders that may be a package; the first existing one is meant."""
    places = [*folders, *_of_environment()]
    return [
        *(place / package for place in places),
        *(place for place in places if package in (place.name, _declared_name(place))),
    ]


def _of_environment() -> list[Path]:
    ros = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
    ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return [
        *(Path(folder) for folder in ros if folder),
        *(Path(folder) / "share" for folder in ament if folder),
    ]


def _declared_name(folder: Path) -> str | None:
    """Return the name in a folder's package.xml: a clone may be called otherwise."""
    try:
        return read_xml(folder / "package.xml").findtext("name")
    except (OSError, ValueError, XmlError):  # none, or a path that can be none
        return None
