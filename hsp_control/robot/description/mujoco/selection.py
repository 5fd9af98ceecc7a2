"""Which bodies of a MuJoCo scene are the robot, and which of its joints move."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    JointNotFoundError,
    ModelError,
)
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.declaration import within
from hsp_control.robot.description.mujoco.constants import constants
from hsp_control.robot.description.mujoco.names import Names


@dataclass(frozen=True, eq=False)
class Selection:
    """A robot in a MuJoCo scene."""

    model: Any  # the compiled model of the scene
    names: Names  # its names
    root: int  # the body whose subtree is the robot; 0: the robot is the whole scene
    bodies: tuple[int, ...]  # the bodies of that subtree, in ascending order
    # the joints that move, in ascending order: the order of q and v
    moving: tuple[int, ...]
    # the scene's configuration, shape (model.nq,): all other joints are locked there,
    # and the robot's home is there
    qpos: Array
    # whether that configuration was chosen; otherwise it is the model's own
    chosen: bool

    @property
    def locked(self) -> tuple[int, ...]:
        """The joints of the robot that do not move."""
        model, moving = self.model, set(self.moving)
        return tuple(
            joint
            for joint in range(model.njnt)
            if model.jnt_bodyid[joint] in self.bodies and joint not in moving
        )


def select(
    model: Any,
    root: str | None = None,
    joints: Sequence[str] | None = None,
    qpos: ArrayLike | None = None,
    keyframe: str | None = None,
    locked: Mapping[str, float] | None = None,
) -> Selection:
    """Return the robot that a root and the names of its moving joints select.

    ``root`` None: the whole scene; ``joints`` None: all of the subtree. The scene's
    configuration is ``qpos`` (model.nq,), or that of a ``keyframe``. ``locked`` joints
    stay at these values [rad or m], whatever the configuration says.
    """
    names = Names(model)
    top = 0
    if root is not None:
        if root not in names.bodies:
            with within("root"):
                raise FrameNotFoundError(
                    f"no body {root!r}{did_you_mean(root, names.bodies)} "
                    f"(the scene has {listing(names.bodies)})"
                )
        top = names.bodies.index(root)
    bodies = _subtree(model, top)
    inside = {
        names.joints[joint]: joint
        for joint in range(model.njnt)
        if int(model.jnt_bodyid[joint]) in bodies
    }
    chosen = set(inside if joints is None else joints) - set(locked or {})
    with within("joints"):
        _check_joints(names, joints or (), inside)
    with within("locked"):
        _check_joints(names, locked or (), inside)
        for name in locked or {}:
            if name in (joints or ()):
                raise ModelError(f"{name!r} is one of the joints that move")
    moving = [joint for name, joint in inside.items() if name in chosen]
    if not moving:
        raise ModelError(
            f"no joint of {names.bodies[top]!r} moves; at least one must be left to "
            "control"
        )
    configuration = _configuration(model, qpos, keyframe)
    for name, value in (locked or {}).items():
        if model.jnt_type[inside[name]] not in _scalar_kinds():
            with within("locked"):
                raise ModelError(f"{name!r} is neither a hinge nor a slide")
        if not np.isfinite(value):
            with within("locked"):
                raise ModelError(f"{name!r} at {value}; needs a finite number")
        configuration[model.jnt_qposadr[inside[name]]] = value
    return Selection(
        model,
        names,
        top,
        tuple(sorted(bodies)),
        tuple(moving),
        configuration,
        chosen=qpos is not None or keyframe is not None,
    )


def _scalar_kinds() -> tuple[int, int]:
    kinds = constants("mjtJoint")
    return kinds.mjJNT_HINGE, kinds.mjJNT_SLIDE


def _subtree(model: Any, top: int) -> set[int]:
    bodies = {top}
    for body in range(top + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in bodies:
            bodies.add(body)
    return bodies


def _check_joints(
    names: Names, joints: Iterable[str], inside: Mapping[str, int]
) -> None:
    """Check that joints exist and are below the root."""
    if isinstance(joints, str):
        raise ModelError(f"{joints!r} is text; needs a list of names")
    for name in joints:
        if name in inside:
            continue
        if name in names.joints:
            raise JointNotFoundError(
                f"{name!r} is a joint of the scene, but not below the root (which has "
                f"{listing(list(inside))})"
            )
        raise JointNotFoundError(
            f"no joint {name!r}{did_you_mean(name, list(inside))} "
            f"(the robot has {listing(list(inside))})"
        )


def _configuration(model: Any, qpos: ArrayLike | None, keyframe: str | None) -> Array:
    if qpos is not None and keyframe is not None:
        raise ModelError("give one of qpos and keyframe")
    if keyframe is not None:
        known = [model.key(i).name for i in range(model.nkey)]
        if keyframe not in known:
            with within("keyframe"):
                raise ModelError(
                    f"no keyframe {keyframe!r}{did_you_mean(keyframe, known)} (the "
                    f"scene has {listing(known) or 'none'})"
                )
        return np.array(model.key_qpos[known.index(keyframe)], dtype=float)
    if qpos is None:
        return np.array(model.qpos0, dtype=float)
    array = np.array(qpos, dtype=float)
    if array.shape != (model.nq,) or not np.isfinite(array).all():
        raise ModelError(
            f"qpos has shape {array.shape}; the scene's configuration has "
            f"({model.nq},), and finite numbers"
        )
    return array
