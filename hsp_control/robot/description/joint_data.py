"""A joint of a Pinocchio model as data: its type, its axis."""

from typing import Any

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import ModelError

TURNING = "JointModelRevoluteUnboundedUnaligned"
_KNOWN = {
    *(f"JointModel{of}{axis}" for of in ("R", "P", "RUB", "H") for axis in "XYZ"),
    "JointModelRevoluteUnaligned", TURNING,
    "JointModelPrismaticUnaligned", "JointModelHelicalUnaligned",
    "JointModelFreeFlyer", "JointModelPlanar", "JointModelSpherical",
    "JointModelTranslation",
}  # fmt: skip


def joint_data(model: pin.Model, k: int) -> dict[str, Any]:
    """Return the data of a joint's own model.

    Raises:
        ModelError: If the type of the joint is not supported.
    """
    joint = model.joints[k]
    if joint.shortname() == "JointModelMimic":
        return _follower_data(model, k)
    if joint.shortname() == TURNING:  # Pinocchio does not give its axis (seen with 4.1)
        axis = _motion(model, k, k, 0.5)[3:] / 0.5
        return {"type": TURNING, "axis": _unit(axis), "pitch": 0.0}
    return _kind_data(joint, model.names[k])


def _kind_data(joint: Any, name: str) -> dict[str, Any]:
    kind, own = joint.shortname(), joint.extract()
    if kind == "JointModelComposite":
        parts = zip(own.joints, own.jointPlacements, strict=True)
        within = [
            {**_kind_data(j, name), "pose": pose_numbers(pose)} for j, pose in parts
        ]
        return {"type": kind, "joints": within}
    if kind not in _KNOWN or kind == TURNING:
        raise ModelError(f"joint {name!r} is a {kind}, which is not supported")
    axis = np.ravel(getattr(own, "axis", ())).tolist()
    return {"type": kind, "axis": axis, "pitch": float(getattr(own, "pitch", 0.0))}


def _follower_data(model: pin.Model, k: int) -> dict[str, Any]:
    """Return the data of a joint that mimics another one.

    Pinocchio does not give the leader: it is found from the motion.
    """
    own = model.joints[k].extract()
    # `model.mimicked_joints` is not in the order of the followers (seen with 4.1).
    leader = next(
        j
        for j in range(1, model.njoints)
        if model.joints[j].nq and model.idx_qs[j] == model.joints[k].idx_q
    )
    # Of a follower that does not move, any joint is right.
    way = _motion(model, leader, k, 0.5 / own.scaling) if own.scaling else _ABOUT_X
    linear, angular = way[:3], way[3:]
    slides = float(np.linalg.norm(angular)) < _LEAST
    if not slides and abs(float(linear @ angular)) > _LEAST:
        raise ModelError(
            f"joint {model.names[k]!r} follows another one along a screw, of which "
            "Pinocchio's mass matrix is wrong (seen with 4.1); let it turn or slide"
        )
    kind, turns = ("Prismatic" if slides else "Revolute"), model.joints[leader].nq == 2
    unit = _unit(linear if slides else angular)
    letter = "XYZ"[int(np.argmax(unit))] if max(unit) == 1.0 else ""
    short = kind[0] + ("UB" if turns and kind == "Revolute" else "")
    long = f"{kind}{'Unbounded' if turns and kind == 'Revolute' else ''}Unaligned"
    return {
        "type": f"JointModel{short}{letter}" if letter else f"JointModel{long}",
        "axis": [] if letter else unit,
        "pitch": 0.0,
        "follows": [leader, float(own.scaling), float(own.offset)],
    }


def _motion(model: pin.Model, moved: int, k: int, by: float) -> Array:
    """Return the twist of joint k for a motion of another one [m and rad]."""
    data, neutral = model.createData(), pin.neutral(model)
    step = np.zeros(model.nv)
    step[model.joints[moved].idx_v] = by
    poses = []
    for q in (neutral, pin.integrate(model, neutral, step)):
        pin.forwardKinematics(model, data, q)
        poses.append(data.liMi[k].copy())
    twist: Array = pin.log6(poses[0].actInv(poses[1])).vector
    return twist


def _unit(axis: Array) -> list[float]:
    rounded = np.round(axis / np.linalg.norm(axis), _DIGITS)
    return [float(each) for each in rounded / np.linalg.norm(rounded)]


_ABOUT_X = np.array([0.0, 0.0, 0.0, 1.0, 0.0, 0.0])
_LEAST, _DIGITS = 1e-9, 14
"""Tolerance of zeros, and the digits of an axis."""


def pose_numbers(placement: pin.SE3) -> list[float]:
    """Return the origin [m], and R row by row."""
    return [*placement.translation.tolist(), *placement.rotation.ravel().tolist()]
