"""Files of triangles that a URDF or a configuration names: found, bounded, checked.

They go to Assimp (distances) and to the page (views), which know no bounds.
"""

import os
import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from hsp_control.common.exceptions import AccessError
from hsp_control.robot.description.access import Access
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.xml_files import XmlError, refuse_document_type

MAX_SIZE = 100_000_000
"""Bytes of a mesh file; the largest of example-robot-data has 13 MB."""
CHECKED = {".stl", ".obj", ".dae"}
"""Formats whose references to other files we know: strict reading takes no other."""

_PICTURE = re.compile(rb"<init_from[^>]*>([^<]*)<")
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+)$", re.M)


def complaint(file: Path) -> str:
    """Return why a mesh file cannot be passed on, or nothing."""
    if not file.is_file():  # a pipe would wait for ever
        return "no such file"
    try:
        size = file.stat().st_size
        if size > MAX_SIZE:
            return f"{size / 1e6:.0f} MB; at most {MAX_SIZE // 1_000_000}"
        if file.suffix.lower() == ".dae":
            refuse_document_type(file.read_bytes())
    except XmlError as error:
        return f"line {error.line}: {error.message}"
    except OSError as error:
        return error.strerror or str(error)
    return ""


def candidates(source: RobotSource, name: str) -> list[Path]:
    """Return where the file that a URDF names may lie; the first that exists is it.

    A superset of the places where Pinocchio and the view look.
    """
    scheme, _, rest = name.rpartition("://")
    if scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        ros = os.environ.get("ROS_PACKAGE_PATH", "").split(os.pathsep)
        ament = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
        folders = [
            *source.package_dirs,
            *(Path(folder) for folder in ros if folder),
            *(Path(folder) / "share" for folder in ament if folder),
        ]
        return [
            *(folder / rest for folder in folders),
            *(folder / inside for folder in folders if folder.name == package),
        ]
    return [source.urdf.parent / rest, *([Path(rest)] if scheme != "file" else [])]


def check_named(source: RobotSource, name: str, what: str, access: Access) -> None:
    """Refuse what a URDF's mesh names, if it is not allowed, and what that names.

    Raises:
        AccessError: If a file lies outside, or its format may name others unseen.
    """
    if not access.strict:
        return
    places = candidates(source, name)
    found = [place for place in places if _exists(place)]
    named_outside = name.rpartition("://")[0] not in ("package", "model")
    # What does not exist is missed later; but no answer says what exists elsewhere.
    for place in found or (places[:1] if named_outside or ".." in name else []):
        access.check(place, what)
    for place in found:
        check_inside(place, what, access)


def check_inside(file: Path, what: str, access: Access) -> None:
    """Refuse a mesh that names files which may not be read, or may do so unseen.

    Raises:
        AccessError: If it does.
    """
    if not access.strict:
        return
    if file.suffix.lower() not in CHECKED:
        raise AccessError(
            f"{what} {str(file)!r}: strict reading takes meshes in "
            f"{', '.join(sorted(CHECKED))} only"
        )
    for name in _references(file):
        access.check(file.parent / name, f"{what} {file.name!r}: its reference")


def _references(file: Path) -> Iterator[str]:
    pattern = {".dae": _PICTURE, ".obj": _LIBRARY}.get(file.suffix.lower())
    if pattern is None or complaint(file):
        return
    for match in pattern.finditer(file.read_bytes()):
        text = match[1].decode("utf-8", "replace").strip().removeprefix("file://")
        if text:
            yield text
            yield unquote(text)


def _exists(path: Path) -> bool:
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False
