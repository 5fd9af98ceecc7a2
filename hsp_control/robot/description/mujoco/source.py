"""What a robot keeps of the MuJoCo model that it comes from."""

import logging
from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.declaration import within
from hsp_control.robot.description.access import ANYWHERE, Access
from hsp_control.robot.description.loading import completed
from hsp_control.robot.description.mujoco.compiling import compile_mjcf
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.dynamics import build_model
from hsp_control.robot.description.mujoco.omissions import omissions
from hsp_control.robot.description.mujoco.selection import Selection, select
from hsp_control.robot.description.mujoco.shapes import body_shapes, excluded_pairs
from hsp_control.robot.description.robot_description import RobotDescription, ToolFrame
from hsp_control.robot.description.sources import RobotSource

_log = logging.getLogger(__name__)


def load_mjcf(
    description: RobotDescription, access: Access
) -> tuple[pin.Model, RobotSource]:
    """Return the Pinocchio model of a description with an MJCF, and its source."""
    assert description.mjcf is not None
    file = Path(description.mjcf)
    with within("mjcf"):
        scene = compile_mjcf(file, access)
    selection = select(
        scene,
        description.root,
        description.joints,
        keyframe=description.keyframe,
        locked=description.locked,
    )
    tools, gravity = description.tool_frames, description.gravity
    return load_selection(selection, tools, gravity, file, access)


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
    scene, kinds = selection.model, constants("mjtJoint")
    return {
        selection.names.joints[joint]: float(selection.qpos[scene.jnt_qposadr[joint]])
        for joint in selection.locked
        if scene.jnt_type[joint] in (kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE)
    }


def _name_of_scene(selection: Selection, file: Path | None) -> str:
    own: bytes = selection.model.names  # begins with the name of the whole model
    name = own.split(b"\0")[0].decode(errors="replace")
    if name in ("", "MuJoCo Model"):  # MuJoCo's default
        return "scene" if file is None else file.stem
    return name


def _home(selection: Selection, model: pin.Model) -> Array:
    """Return the displacement from neutral to the scene's configuration, shape (nv,).

    If nobody chose that configuration, a joint which is not within its limits there is
    in their middle: many arms are straight at zero, or beyond a limit.
    """
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
