"""Which bodies of a MuJoCo scene are the robot, and which of its joints move."""

from collections.abc import Sequence
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
from hsp_control.robot.description.mujoco.names import Names


@dataclass(frozen=True, eq=False)
class Selection:
    """A robot in a MuJoCo scene.

    Attributes:
        model: The compiled model of the scene.
        names: Its names.
        root: The body whose subtree is the robot; 0: the robot is the whole scene.
        bodies: The bodies of that subtree, in ascending order.
        moving: The joints that move, in ascending order: the order of q and v.
        qpos: The scene's configuration, shape (model.nq,): all other joints are locked
            there, and the robot's home is there.
        chosen: Whether that configuration was chosen; otherwise it is the model's own.
    """

    model: Any
    names: Names
    root: int
    bodies: tuple[int, ...]
    moving: tuple[int, ...]
    qpos: Array
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
) -> Selection:
    """Return the robot that a root and the names of its moving joints select.

    Args:
        model: The compiled model.
        root: Name of the body whose subtree is the robot; None: the whole scene.
        joints: Names of the joints that move; None: all joints of the subtree.
        qpos: The scene's configuration, shape (model.nq,).
        keyframe: The name of that configuration in the model, instead.

    Raises:
        FrameNotFoundError: If there is no such body.
        JointNotFoundError: If the subtree has no such joint.
        ModelError: If no joint moves, both configurations are given, there is no such
            keyframe, or the configuration is not one of the scene.
    """
    names = Names(model)
    top = 0
    if root is not None:
        if root not in names.bodies:
            raise FrameNotFoundError(
                f"root: no body {root!r}{did_you_mean(root, names.bodies)} "
                f"(the scene has {listing(names.bodies)})"
            )
        top = names.bodies.index(root)
    bodies = _subtree(model, top)
    inside = [j for j in range(model.njnt) if int(model.jnt_bodyid[j]) in bodies]
    moving = inside if joints is None else _named(names, joints, inside, root)
    if not moving:
        raise ModelError(
            f"no joint of {names.bodies[top]!r} moves; at least one must be left to "
            "control"
        )
    configuration = _configuration(model, qpos, keyframe)
    return Selection(
        model,
        names,
        top,
        tuple(sorted(bodies)),
        tuple(moving),
        configuration,
        chosen=qpos is not None or keyframe is not None,
    )


def _subtree(model: Any, top: int) -> set[int]:
    bodies = {top}
    for body in range(top + 1, model.nbody):  # parents come first
        if int(model.body_parentid[body]) in bodies:
            bodies.add(body)
    return bodies


def _named(
    names: Names, joints: Sequence[str], inside: list[int], root: str | None
) -> list[int]:
    if isinstance(joints, str):
        raise ModelError(f"joints is {joints!r}; needs a list of names")
    known = {names.joints[joint]: joint for joint in inside}
    for name in joints:
        if name in known:
            continue
        if name in names.joints:
            raise JointNotFoundError(
                f"joints: {name!r} is a joint of the scene, but not below the root "
                f"{root!r} (which has {listing(list(known))})"
            )
        raise JointNotFoundError(
            f"joints: no joint {name!r}{did_you_mean(name, list(known))} "
            f"(the robot has {listing(list(known))})"
        )
    chosen = set(joints)
    return [joint for name, joint in known.items() if name in chosen]


def _configuration(model: Any, qpos: ArrayLike | None, keyframe: str | None) -> Array:
    if qpos is not None and keyframe is not None:
        raise ModelError("give one of qpos and keyframe")
    if keyframe is not None:
        known = [model.key(i).name for i in range(model.nkey)]
        if keyframe not in known:
            raise ModelError(
                f"no keyframe {keyframe!r}{did_you_mean(keyframe, known)} (the scene "
                f"has {listing(known)})"
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
