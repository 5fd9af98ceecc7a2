"""Find and check mesh files that a URDF or a configuration names.

The files are passed to Assimp (distances) and to the browser (views), which do not
limit their size.
"""

import re
from collections.abc import Iterator
from pathlib import Path
from urllib.parse import unquote

from hsp_control.common.errors import AccessError
from hsp_control.common.regular_file import why_endless
from hsp_control.common.resources import is_file
from hsp_control.robot.description.access import (
    Access,
    XmlError,
    check_no_document_type,
)
from hsp_control.robot.description.mesh_units import mesh_units
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.xacro_files import package_folders

MAX_SIZE = 100_000_000
"""Maximum size of a mesh file [bytes]; example-robot-data has up to 13 MB."""
CHECKED = {".stl", ".obj", ".dae"}
"""Formats whose references to other files are checked.

Strict reading allows no other formats.
"""
PICTURES = {".bmp", ".gif", ".jpeg", ".jpg", ".png", ".tga", ".tif", ".tiff", ".webp"}
"""Image files that a texture may name: others must not get into a page or a log."""

_HEADING = 65536
"""Length in which the heading of a mesh file ends [bytes]."""
_COUNTS = {
    ".ply": re.compile(rb"^\s*element[ \t]+\w+[ \t]+(\d+)", re.M),
    ".off": re.compile(rb"\A\s*\w*OFF\s+(?:#.*\s+)*(\d+)[ \t]+(\d+)"),
}
"""The numbers of elements in a heading; each is a byte at least."""
_PICTURE = re.compile(rb"<init_from[^>]*>([^<]*)<")
_LIBRARY = re.compile(rb"^[ \t]*mtllib[ \t]+(.+)$", re.M)


def find_problem(file: Path) -> str:
    """Return why a mesh file cannot be used, or an empty string."""
    if not file.is_file() or why_endless(file):  # reading would block
        return "not a file" if _is_there(file) else "no such file"
    try:
        size = file.stat().st_size
        if size > MAX_SIZE:
            return f"{size / 1e6:.0f} MB; at most {MAX_SIZE // 1_000_000} MB"
        if file.suffix.lower() == ".dae":
            check_no_document_type(file.read_bytes())
            mesh_units(file)
        with file.open("rb") as data:
            declared = _declared(file.suffix.lower(), data.read(_HEADING))
        if declared > size:  # Assimp reads as many, however short the file is
            return f"its heading declares {declared} elements, in {size} bytes"
    except ValueError as error:
        return str(error)
    except XmlError as error:
        return f"line {error.line}: {error.message}"
    except OSError as error:
        return error.strerror or str(error)
    return ""


def _declared(ending: str, heading: bytes) -> int:
    """Return the number of elements in a mesh file's heading; 0 without a count."""
    if ending not in _COUNTS:
        return 0
    counts = _COUNTS[ending].finditer(heading.partition(b"end_header")[0])
    return sum(int(number[:20]) for found in counts for number in found.groups())


def candidates(source: RobotSource, name: str) -> list[Path]:
    """Return the paths that a file name in a URDF may mean; the first existing wins."""
    return [*(f for n, f in source.meshes if n == name), *places(source, name)]


def places(source: RobotSource, name: str) -> list[Path]:
    """Return the paths on this computer that a file name in a URDF may mean."""
    scheme, _, rest = name.rpartition("://")
    if scheme in ("package", "model"):
        package, _, inside = rest.partition("/")
        folders = package_folders(package, source.package_dirs)
        return [folder / inside for folder in folders]
    return [source.urdf.parent / rest, *([Path(rest)] if scheme != "file" else [])]


def find_file(source: RobotSource, name: str) -> Path | None:
    """Return the file of a name in a URDF; None if there is none."""
    known = candidates(source, name)
    file = next(filter(is_file, known), None)
    return file or next(filter(_is_there, known), None)


def where_to_put(name: str) -> str:
    """Return where a missing file is searched, and how to change that."""
    scheme, _, rest = name.rpartition("://")
    if scheme not in ("package", "model"):
        return "the path is relative to the URDF"
    package = rest.partition("/")[0]
    return (
        f"the package {package!r} is looked for beside the URDF, above it, and along "
        "ROS_PACKAGE_PATH: "
        f"export ROS_PACKAGE_PATH=<the folder that contains {package}>"
    )


def check_mesh_name(source: RobotSource, name: str, what: str, access: Access) -> None:
    """Check that a file that a URDF names may be read, and the files it refers to."""
    if not access.strict:
        return
    known = candidates(source, name)
    found = [place for place in known if is_file(place)]
    named_outside = name.rpartition("://")[0] not in ("package", "model")
    # A missing file is reported later. But a path outside the allowed folders is an
    # error in any case, so that the message does not reveal which files exist there.
    for place in found or (known[:1] if named_outside or ".." in name else []):
        access.check(place, what)
    for place in found:
        check_references(place, what, access)


def check_references(file: Path, what: str, access: Access) -> None:
    """Check that all files that a mesh file refers to may be read."""
    if not access.strict:
        return
    if file.suffix.lower() not in CHECKED:
        raise AccessError(
            f"{what} {str(file)!r}: strict reading allows only meshes in "
            f"{', '.join(sorted(CHECKED))}"
        )
    for name in _references(file):
        access.check(file.parent / name, f"{what} {file.name!r}: its reference")


def _references(file: Path) -> Iterator[str]:
    pattern = {".dae": _PICTURE, ".obj": _LIBRARY}.get(file.suffix.lower())
    if pattern is None or find_problem(file):
        return
    for match in pattern.finditer(file.read_bytes()):
        text = match[1].decode("utf-8", "replace").strip().removeprefix("file://")
        if text:
            yield text
            yield unquote(text)


def _is_there(path: Path) -> bool:
    try:
        return path.exists()
    except (OSError, ValueError):
        return False
