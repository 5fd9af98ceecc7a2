"""The meshes of a log: their data, and the files made from these.

A mesh is written with the pictures of a Collada file and the buffers of a glTF file,
which are separate files. A material library of an OBJ file is drawn by nothing here.
"""

import json
import logging
import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import lru_cache
from hashlib import sha256
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple
from xml.etree.ElementTree import Element

from hsp_control.common.errors import ModelError
from hsp_control.common.resources import is_file
from hsp_control.common.suggestions import listing
from hsp_control.robot.description.access import XmlError, parse_xml
from hsp_control.robot.description.mesh_files import (
    CHECKED,
    PICTURES,
    find_file,
    find_problem,
)
from hsp_control.robot.description.recorded_model import packed, unpacked
from hsp_control.robot.description.sources import RobotSource

FORMATS = CHECKED | {".ply", ".off", ".gltf", ".glb"}
MOST = 5_000_000
"""Most bytes of a robot's meshes in a log, packed.

It suffices for nearly all arms. Runs of a sweep have a log each, so a log should not
become much larger than its columns.
"""
UNPACKED = 20 * MOST
"""Most bytes of the same files as they are: a Collada file packs by five to ten."""
_BESIDE = PICTURES | {".bin"}

_log = logging.getLogger(__name__)


def robot_meshes(source: RobotSource, urdf: bytes) -> dict[str, Any]:
    """Return the meshes of a robot as JSON data, by their names in its URDF.

    Those that distances are measured to come first, then the smallest. Meshes of
    packages that are installed with pip are not part of a log.
    """
    if source.origin not in ("file", "robot_descriptions"):
        return {"meshes": {}}
    try:
        root = parse_xml(urdf)
    except XmlError:
        return {"meshes": {}}
    files: dict[str, Path] = {}
    for kind in ("collision", "visual"):
        names = {mesh.get("filename", "") for mesh in _meshes(root.iter(kind))}
        found = {name: find_file(source, name) for name in names - {*files}}
        there = {name: file for name, file in found.items() if file is not None}
        files |= dict(sorted(there.items(), key=_size))
    return mesh_data(f"the robot {source.name}", files)


def _meshes(shapes: Iterable[Element]) -> Iterator[Element]:
    for shape in shapes:
        yield from shape.iter("mesh")


def _size(named: tuple[str, Path]) -> tuple[int, str]:
    """Return the key that sorts files by size; equal ones by name."""
    name, file = named
    return file.stat().st_size, name


def mesh_data(owner: str, files: Mapping[str, Path]) -> dict[str, Any]:
    """Return meshes as JSON data; a warning names those that do not fit.

    Args:
        owner: Whose meshes they are, for the warning.
        files: Their files by name, the most important first.
    """
    meshes: dict[str, str] = {}
    beside: dict[str, str] = {}
    left_out: dict[str, str] = {}
    left, left_unpacked = MOST, UNPACKED
    for name, file in files.items():
        if find_problem(file):
            continue
        if file.suffix.lower() not in FORMATS:
            left_out[name] = f"a format that no log contains, {file.suffix:.10}"
            continue
        about = file.stat()
        size = f"{about.st_size / 1e6:.1f} MB"
        if about.st_size > left_unpacked:
            left_out[name] = size
            continue
        mesh = _packed(str(file), about.st_size, about.st_mtime_ns)
        others = {k: text for k, text in mesh.beside.items() if k not in beside}
        needed = len(mesh.content) + sum(map(len, others.values()))
        if needed > left or mesh.unpacked > left_unpacked:
            left_out[name] = size
            continue
        left, left_unpacked = left - needed, left_unpacked - mesh.unpacked
        meshes[name] = mesh.content
        beside |= others
    if left_out:
        _warn(owner, tuple(left_out.items()))
    return {"meshes": meshes, "beside": beside, "left_out": left_out}


@lru_cache(maxsize=100)
def _warn(owner: str, left_out: tuple[tuple[str, str], ...]) -> None:
    """Report once in a process which meshes its logs lack."""
    names = listing(f"{name} ({why})" for name, why in left_out)
    _log.warning(
        "logs of %s have no room for %d of its meshes (at most %g MB, packed): %s; "
        "where these files are not, capsules or balls are drawn in their place, and "
        "distances do not see them",
        owner, len(left_out), MOST / 1e6, names,
    )  # fmt: skip


class _Packed(NamedTuple):
    """A mesh file that names only files beside it, packed."""

    content: str
    beside: dict[str, str]  # these files, by names of their contents
    unpacked: int  # bytes of all of them as they are


@lru_cache(maxsize=1000)
def _packed(file: str, _size: int, _changed: int) -> _Packed:
    content, beside = _whole(Path(file))
    return _Packed(
        packed(content, level=6),
        {name: packed(data, level=6) for name, data in beside.items()},
        len(content) + sum(map(len, beside.values())),
    )


def _whole(file: Path) -> tuple[bytes, dict[str, bytes]]:
    """Return a mesh file that names only files beside it, and these by name."""
    beside: dict[str, bytes] = {}

    def renamed(name: str, endings: Iterable[str]) -> str:
        other = file.parent / name.removeprefix("file://")
        ending = other.suffix.lower()
        if not is_file(other) or ending not in endings or _is_too_large(other):
            return name
        data = other.read_bytes()
        new = _named(data) + ending
        beside[new] = data
        return new

    content = file.read_bytes()
    if rewrite := _REWRITTEN.get(file.suffix.lower()):
        content = rewrite(content, renamed)
    return content, beside


def _is_too_large(file: Path) -> bool:
    return file.stat().st_size > UNPACKED


_Renamed = Callable[[str, Iterable[str]], str]


def _of_collada(content: bytes, renamed: _Renamed) -> bytes:
    def picture(match: re.Match[bytes]) -> bytes:
        name = match[2].decode("utf-8", "replace").strip()
        new = renamed(name, PICTURES)
        return match[0] if new == name else match[1] + new.encode() + b"<"

    return re.sub(rb"(<init_from[^>]*>)([^<]*)<", picture, content)


def _of_gltf(content: bytes, renamed: _Renamed) -> bytes:
    try:
        scene = json.loads(content)
        for buffer in scene.get("buffers", []):
            name = buffer.get("uri", "")
            if name and not name.startswith("data:"):
                buffer["uri"] = renamed(name, {".bin"})
    except (ValueError, AttributeError, TypeError):  # the reader of the mesh reports it
        return content
    return json.dumps(scene, separators=(",", ":")).encode()


_REWRITTEN = {".dae": _of_collada, ".gltf": _of_gltf}


def recorded_meshes(data: Any) -> dict[str, Path]:
    """Return files of recorded meshes by their names, until this process ends.

    Raises:
        ModelError: If they are damaged, or of more bytes than a log contains.
    """
    if not isinstance(data, Mapping):
        raise ModelError("the recorded meshes are damaged")
    meshes, beside = data.get("meshes", {}), data.get("beside", {})
    if not isinstance(meshes, Mapping) or not isinstance(beside, Mapping):
        raise ModelError("the recorded meshes are damaged")
    left, left_unpacked = MOST, UNPACKED

    def file_of(name: Any, text: Any, endings: Iterable[str]) -> Path:
        nonlocal left, left_unpacked
        content = unpacked(text)
        left, left_unpacked = left - len(text), left_unpacked - len(content)
        ending = Path(str(name)).suffix.lower()
        if min(left, left_unpacked) < 0 or ending not in endings:
            raise ModelError(f"the recorded mesh {name!r:.80} is damaged")
        return _write(_named(content) + ending, content)

    for name, text in beside.items():
        if file_of(name, text, _BESIDE).name != name:
            raise ModelError(f"the recorded file {name!r:.80} is damaged")
    return {str(n): file_of(n, text, FORMATS) for n, text in meshes.items()}


def is_recorded(file: Path, recorded: Path) -> bool:
    """Return whether a file is the same as in the log."""
    if find_problem(file):
        return False
    return _named(_whole(file)[0]) == recorded.stem


def _named(content: bytes) -> str:
    return sha256(content).hexdigest()[:32]


def _write(name: str, content: bytes) -> Path:
    file = Path(_kept().name) / name
    if not file.is_file():
        file.write_bytes(content)
    return file


@lru_cache(maxsize=1)
def _kept() -> TemporaryDirectory[str]:
    """Return a folder that is removed when the process ends."""
    return TemporaryDirectory(prefix="hsp-meshes-")
