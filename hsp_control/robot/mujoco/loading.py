"""A robot out of an MJCF or a compiled MuJoCo model."""

import logging
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import AccessError, ModelError, RobotNotFoundError
from hsp_control.common.suggestions import did_you_mean
from hsp_control.declaration import within
from hsp_control.robot.description.access import (
    ANYWHERE,
    Access,
    XmlError,
    read_xml,
)
from hsp_control.robot.description.loading import completed
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource
from hsp_control.robot.description.urdf import MAX_DOFS, MAX_LINKS
from hsp_control.robot.mujoco.conversion import (
    body_shapes,
    build_model,
    excluded_pairs,
)
from hsp_control.robot.mujoco.omissions import omissions
from hsp_control.robot.mujoco.scene import (
    Selection,
    constants,
    import_mujoco,
    is_scalar,
    select,
)

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


_log = logging.getLogger(__name__)


def load_mjcf(
    description: RobotDescription, access: Access
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a description with an MJCF, and its source."""
    told = description
    file = Path(told.mjcf or "")
    with within("mjcf"):
        scene = compile_mjcf(file, access)
    given = told.root, told.joints, None, told.keyframe, told.locked
    selection = select(scene, *given)
    return load_selection(selection, told.tool_frames, told.gravity, file, access)


def load_selection(
    selection: Selection,
    tool_frames: Mapping[str, ToolFrame],
    gravity: ArrayLike | None = None,
    file: Path | None = None,
    access: Access = ANYWHERE,
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a robot in a MuJoCo scene, and its source."""
    model = build_model(selection)
    name = model.name if selection.root else _name_of_scene(selection, file)
    floating = any(joint.shortname() == "JointModelFreeFlyer" for joint in model.joints)
    omitted = omissions(selection)
    for sentence in omitted:
        _warn(name, sentence)
    source = RobotSource(
        name=name,
        urdf=file or Path(name),
        root="free_flyer" if floating else "fixed",
        origin="mujoco",
        home=tuple(map(float, _home(selection, model))),
        locked=_locked(selection),
        access=access,
        shapes=body_shapes(selection),
        excluded=excluded_pairs(selection),
        omitted=omitted,
    )
    return completed(model, source, tool_frames, gravity), source


@cache
def _warn(robot: str, sentence: str) -> None:
    """Log what a robot lacks, once: simulators make the same robot at every reset."""
    _log.warning("%s, as MuJoCo has it, but without: %s", robot, sentence)


def _locked(selection: Selection) -> dict[str, float]:
    """Return where the locked hinges and slides of the robot are [rad or m]."""
    scene, names = selection.model, selection.names.joints
    return {
        names[joint]: float(selection.qpos[scene.jnt_qposadr[joint]])
        for joint in selection.locked
        if is_scalar(scene, joint)
    }


def _name_of_scene(selection: Selection, file: Path | None) -> str:
    own: bytes = selection.model.names  # begins with the name of the whole model
    name = own.split(b"\0")[0].decode(errors="replace")
    if name in ("", "MuJoCo Model"):  # MuJoCo's default
        return "scene" if file is None else file.stem
    return name


def _home(selection: Selection, model: pin.Model) -> Array:
    """Return the scene's configuration from neutral (nv,); within limits."""
    scene, kinds = selection.model, constants("mjtJoint")
    q = pin.neutral(model)
    for index, joint in enumerate(selection.moving, start=1):
        at, mine = int(scene.jnt_qposadr[joint]), int(model.idx_qs[index])
        part = selection.qpos[at : at + int(model.nqs[index])].copy()
        if scene.jnt_type[joint] in (kinds.mjJNT_FREE, kinds.mjJNT_BALL):
            part[-4:] = np.roll(part[-4:], -1)  # w x y z to x y z w
        elif not selection.chosen:
            low, high = model.lowerPositionLimit[mine], model.upperPositionLimit[mine]
            if not low < part[0] < high and np.isfinite(low + high):
                part[0] = 0.5 * (low + high)
        q[mine : mine + len(part)] = part
    return np.asarray(
        pin.difference(model, pin.neutral(model), pin.normalize(model, q))
    )
