"""A robot's dynamics in the engine, made from the numbers of a Pinocchio model.

The engine has Pinocchio's algorithms compiled in. So a model crosses to it as numbers,
and whichever release of Pinocchio loaded it, the same code steps.
"""

from typing import Any, NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control.engine import Dynamics
from hsp_control.robot.description.joint_data import joint_data, pose_numbers

_AXES = {"X": (1.0, 0.0, 0.0), "Y": (0.0, 1.0, 0.0), "Z": (0.0, 0.0, 1.0)}
_ALONG_AN_AXIS = {
    "P": "Prismatic",
    "RUB": "RevoluteUnbounded",
    "H": "Helical",
    "PrismaticUnaligned": "Prismatic",
    "RevoluteUnaligned": "Revolute",
    "RevoluteUnboundedUnaligned": "RevoluteUnbounded",
    "HelicalUnaligned": "Helical",
}
"""The engine's names of joints with an axis, except RX, RY and RZ."""


class JointNumbers(NamedTuple):
    """A joint and the body that it moves, as the engine has them."""

    name: str
    type: str
    parent: int  # 0: the world
    placement: tuple[float, ...]  # in the parent: R, row by row, and the origin [m]
    axis: tuple[float, ...]
    pitch: float  # of a screw [m/rad]
    leader: int  # the joint that it follows: q = ratio q_leader + offset; 0: none
    ratio: float
    offset: float
    parts: tuple["JointNumbers", ...]  # of a composite joint
    mass: float  # of the body [kg]
    center: tuple[float, ...]  # of mass [m]
    inertia: tuple[float, ...]  # about it, row by row [kg·m²]


ModelNumbers = tuple[tuple[JointNumbers, ...], tuple[float, ...], tuple[float, ...]]
"""The joints in order, gravity [m/s²], and the rotors' part of the diagonal of M."""


def model_numbers(model: pin.Model) -> ModelNumbers:
    """Return a model as an argument of `engine.Dynamics`.

    Raises:
        ModelError: If a joint is of a type that the engine does not have.
    """
    joints = []
    for k in range(1, model.njoints):
        data, body = joint_data(model, k), model.inertias[k]
        joint = _joint(model.names[k], data, pose_numbers(model.jointPlacements[k]))
        joints.append(
            joint._replace(
                parent=int(model.parents[k]),
                mass=float(body.mass),
                center=_numbers(body.lever),
                inertia=_numbers(body.inertia),
            )
        )
    gravity = _numbers(model.gravity.linear)
    return tuple(joints), gravity, _numbers(model.armature)


def dynamics_of(model: pin.Model) -> Dynamics:
    """Return the dynamics of a model, with their own memory."""
    return Dynamics(*model_numbers(model))


def _joint(name: str, data: dict[str, Any], pose: list[float]) -> JointNumbers:
    kind = data["type"].removeprefix("JointModel")
    axis = tuple(data.get("axis") or _AXES.get(kind[-1], _AXES["X"]))
    if kind not in ("RX", "RY", "RZ"):
        along = kind[:-1] if kind[-1] in _AXES else kind
        kind = _ALONG_AN_AXIS.get(along, kind)
    leader, ratio, offset = data.get("follows", (0, 1.0, 0.0))
    parts = [_joint(name, part, part["pose"]) for part in data.get("joints", ())]
    placement = (*pose[3:], *pose[:3])
    return JointNumbers(
        name, f"JointModel{kind}", 0, placement, axis, data.get("pitch", 0.0),
        leader, ratio, offset, tuple(parts), 0.0, (0.0,) * 3, (0.0,) * 9,
    )  # fmt: skip


def _numbers(array: Any) -> tuple[float, ...]:
    return tuple(np.asarray(array, dtype=float).ravel().tolist())
