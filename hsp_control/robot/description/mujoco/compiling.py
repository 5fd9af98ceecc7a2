"""Compiles an MJCF file; MuJoCo itself reads it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

from hsp_control.common.exceptions import AccessError, ModelError, RobotNotFoundError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.robot.description.access import Access
from hsp_control.robot.description.mujoco.constants import import_mujoco
from hsp_control.robot.description.urdf_checks import MAX_DOFS, MAX_LINKS
from hsp_control.robot.description.xml_files import XmlError, read_xml

_FOLDERS = "meshdir", "texturedir", "assetdir"
_REFUSED = "plugin", "replicate", "composite", "flexcomp"
"""Elements that run code, or that stand for any number of bodies."""
_MAX_FILES = 200
"""Maximum number of files that an MJCF may include; a loop of them ends there."""


def compile_mjcf(path: Path, access: Access) -> Any:
    """Return the ``mujoco.MjModel`` of an MJCF file."""
    access.check(path, "mjcf")
    if not path.is_file():
        near = sorted(file.name for file in path.parent.glob("*.xml"))
        raise RobotNotFoundError(f"{path}: no such file{did_you_mean(path.name, near)}")
    top = _read(path)
    if top.tag != "mujoco":
        hint = "; give a URDF as name" if top.tag == "robot" else ""
        raise ModelError(
            f"{path}: the top element is <{top.tag}>; in an MJCF it is <mujoco>{hint}"
        )
    if access.strict:
        _check_access(path, top, access)
    mujoco = import_mujoco()
    try:
        model = mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise ModelError(f"{path}: MuJoCo rejects it: {reason}") from error
    for count, limit, what in (
        (model.nbody, MAX_LINKS, "bodies"),
        (model.nv, MAX_DOFS, "degrees of freedom"),
    ):
        if count > limit:
            raise ModelError(f"{path}: {count} {what}; at most {limit}")
    return model


def _read(path: Path) -> Element:
    try:
        return read_xml(path)
    except XmlError as error:
        raise ModelError(error.within(path)) from None
    except OSError as error:
        raise RobotNotFoundError(f"{path}: {error.strerror}") from error


def _check_access(path: Path, top: Element, access: Access) -> None:
    """Check every file that an MJCF names, also in the files that it includes."""
    pending, checked = [(path, top)], 0
    while pending:
        file, root = pending.pop()
        checked += 1
        if checked > _MAX_FILES:
            raise AccessError(f"{path}: includes more than {_MAX_FILES} files")
        for tag in _REFUSED:
            if next(root.iter(tag), None) is not None:
                raise AccessError(f"{file}: strict reading allows no <{tag}>")
        for name, element in _named(root):
            for place in _places(path.parent, file.parent, root, name):
                access.check(place, f"{file}: <{element.tag}>")
                if element.tag in ("include", "model") and place.is_file():
                    pending.append((place, _read(place)))


def _named(root: Element) -> Iterator[tuple[str, Element]]:
    """Yield the value of every attribute ``file...`` with its element."""
    for element in root.iter():
        for attribute, value in element.attrib.items():
            if attribute.startswith("file"):
                yield value, element


def _places(main: Path, own: Path, root: Element, name: str) -> set[Path]:
    """Return where MuJoCo may look for a file: in more places rather than in fewer."""
    folders = [Path()]
    for compiler in root.iter("compiler"):
        folders += [Path(compiler.get(key, "")) for key in _FOLDERS]
    return {base / folder / name for base in (main, own) for folder in folders}
