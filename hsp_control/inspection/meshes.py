"""Mesh files that a URDF names and that are not there."""

from collections.abc import Iterator
from xml.etree.ElementTree import Element

from hsp_control.common.suggestions import listing
from hsp_control.inspection.finding import Finding
from hsp_control.robot.description.mesh_files import (
    find_file,
    find_problem,
    where_to_put,
)
from hsp_control.robot.description.sources import RobotSource

_WITHOUT = {
    "collision": "distances do not see these links, if they have no other shape",
    "visual": "capsules are drawn instead",
}


def check_meshes(xml: Element, source: RobotSource) -> Iterator[Finding]:
    """Yield the meshes that are missing or cannot be read, by use and by cure."""
    for use, without in _WITHOUT.items():
        unusable: dict[tuple[str, str], dict[str, str]] = {}
        for link in xml.findall("link"):
            for mesh in (m for each in link.findall(use) for m in each.iter("mesh")):
                name = mesh.get("filename", "")
                file = find_file(source, name)
                reason = "no such file" if file is None else find_problem(file)
                if reason:
                    cure = where_to_put(name) if file is None else "repair the file"
                    links = unusable.setdefault((reason, cure), {})
                    links.setdefault(link.get("name", ""), name)
        for (reason, cure), names in unusable.items():
            first = next(iter(names.values()))
            meshes = f"{use} mesh{'es' * (len(names) > 1)} of {listing(names)}"
            message = f"{reason}: {first}{', ...' * (len(names) > 1)}; {without}"
            yield Finding("warning", "mesh", meshes, message, cure)
