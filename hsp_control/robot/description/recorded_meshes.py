"""The meshes of a log's robot: what is written of them, and files made of it."""

from collections.abc import Iterator, Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from xml.etree.ElementTree import Element

from hsp_control.common.exceptions import ModelError
from hsp_control.robot.description.access import XmlError, parse_xml
from hsp_control.robot.description.mesh_files import CHECKED, find_file, find_problem
from hsp_control.robot.description.recorded_model import packed, unpacked
from hsp_control.robot.description.sources import RobotSource

FORMATS = CHECKED | {".ply", ".off", ".gltf", ".glb"}
MOST = 4_000_000
"""Most bytes of meshes that a log contains, before they are packed."""


def meshes_data(source: RobotSource, urdf: bytes) -> dict[str, str]:
    """Return the packed meshes of a robot by their names in its URDF.

    Only those of somebody's own files: packages are on other computers as well. The
    shapes that distances are measured to come first; what is beyond `MOST` is left out.
    """
    if source.origin != "file":
        return {}
    found: dict[str, str] = {}
    left = MOST
    for name in _names(urdf):
        file = find_file(source, name)
        if name in found or file is None or find_problem(file):
            continue
        if file.suffix.lower() not in FORMATS:
            continue
        about = file.stat()
        if about.st_size <= left:
            left -= about.st_size
            found[name] = _packed(str(file), about.st_size, about.st_mtime_ns)
    return found


def _names(urdf: bytes) -> Iterator[str]:
    """Yield the names of a URDF's meshes, those of collisions first."""
    try:
        root = parse_xml(urdf)
    except XmlError:
        return
    for kind in ("collision", "visual"):
        for shape in root.iter(kind):
            yield from _files(shape)


def _files(shape: Element) -> Iterator[str]:
    for mesh in shape.iter("mesh"):
        if name := mesh.get("filename"):
            yield name


@lru_cache(maxsize=1000)
def _packed(file: str, _size: int, _changed: int) -> str:
    return packed(Path(file).read_bytes())


def meshes_of(data: Any) -> tuple[tuple[str, Path], ...]:
    """Return files of recorded meshes by their names, until this process ends.

    Raises:
        ModelError: If they are damaged, or of more bytes than a log contains.
    """
    if not isinstance(data, Mapping):
        raise ModelError("the recorded meshes are damaged")
    found, left = [], MOST
    for name, text in data.items():
        content = unpacked(text)
        left -= len(content)
        suffix = Path(str(name)).suffix.lower()
        if left < 0 or suffix not in FORMATS:
            raise ModelError(f"the recorded mesh {name!r:.80} is damaged")
        file = _folder() / (sha256(content).hexdigest()[:32] + suffix)
        if not file.is_file():
            file.write_bytes(content)
        found.append((str(name), file))
    return tuple(found)


def _folder() -> Path:
    return Path(_kept().name)


@lru_cache(maxsize=1)
def _kept() -> TemporaryDirectory[str]:
    """Return a folder that is removed when the process ends."""
    return TemporaryDirectory(prefix="hsp-meshes-")
