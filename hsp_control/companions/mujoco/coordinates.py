"""Converts between Pinocchio's coordinates and MuJoCo's.

======== ================================== =====================================
joint    Pinocchio's q and v                MuJoCo's qpos and qvel
======== ================================== =====================================
hinge    value; rate                        the same
slide    value; rate                        the same
cont.    cos, sin; rate                     an angle; rate
ball     quaternion x y z w; ω in the child w x y z; the same ω
planar   x, y, cos, sin; v and ω in the     two slides along the parent's axes and a
         child                              hinge
free     position and x y z w in the joint; in the world, w x y z; v in the world, ω
         v and ω in the child               in the child
mimic    none                               a joint, coupled to its leader
======== ================================== =====================================

MuJoCo may also number joints and degrees of freedom in another order.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Self

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.errors import JointNotFoundError, ModelError
from hsp_control.common.suggestions import did_you_mean, listing
from hsp_control.companions.mujoco.scene import Names
from hsp_control.robot.robot import Robot

FREE, PLANAR, SPHERICAL, CONTINUOUS, HINGE, SLIDE = (
    "free",
    "planar",
    "spherical",
    "continuous",
    "hinge",
    "slide",
)
_KINDS = {
    "JointModelFreeFlyer": FREE,
    "JointModelPlanar": PLANAR,
    "JointModelSpherical": SPHERICAL,
    "JointModelRUB": CONTINUOUS,
    "JointModelRevoluteUnboundedUnaligned": CONTINUOUS,
    "JointModelR": HINGE,
    "JointModelP": SLIDE,
}
"""Kinds by the beginning of Pinocchio's short names, the longer ones first."""


@dataclass(frozen=True)
class Joint:
    """A joint of the Pinocchio model, with its data for MuJoCo."""

    name: str  # its name
    index: int  # its index in the Pinocchio model
    kind: str  # one of the constants above
    q: int  # index in q where its configuration (a mimic joint: its leader's) begins
    v: int  # index in v where its velocity (a mimic joint: its leader's) begins
    axis: Array  # the axis of a hinge or a slide, shape (3,)
    leader: "Joint | None" = None  # the joint that it mimics, if any
    scaling: float = 1.0  # factor in position = scaling · leader's position + offset
    offset: float = 0.0  # offset in that formula [rad or m]

    @property
    def mujoco_names(self) -> tuple[str, ...]:
        """The names of the MuJoCo joints that represent it."""
        if self.kind != PLANAR:
            return (self.name,)
        return tuple(f"{self.name}.{dof}" for dof in ("x", "y", "yaw"))


def joints_of(robot: Robot) -> list[Joint]:
    """Return the robot's joints in Pinocchio's order, including mimic joints."""
    model = robot.model
    found: list[Joint] = []
    for index in range(1, model.njoints):
        model_joint, name = model.joints[index], str(model.names[index])
        data = model_joint.createData()
        model_joint.calc(data, pin.neutral(model))
        if "Mimic" in model_joint.shortname():
            follower = model_joint.extract()
            leader = next(joint for joint in found if joint.q == follower.idx_q)
            axis = _axis(data) / np.sign(follower.scaling)
            kind = SLIDE if leader.kind == SLIDE else HINGE
            ratio, shift = float(follower.scaling), float(follower.offset)
            joint = Joint(
                name, index, kind, leader.q, leader.v, axis, leader, ratio, shift
            )
        else:
            kind = _kind(model_joint, name, robot)
            if kind in (FREE, PLANAR) and model.parents[index] != 0:
                raise ModelError(
                    f"{robot.name}: joint {name!r} is {kind} but not the root's; "
                    "MuJoCo supports such joints only at the root"
                )
            axis = _axis(data) if model_joint.nv == 1 else np.zeros(3)
            joint = Joint(name, index, kind, model_joint.idx_q, model_joint.idx_v, axis)
        found.append(joint)
    return found


def _kind(joint: Any, name: str, robot: Robot) -> str:
    short = str(joint.shortname())
    kind = next((_KINDS[k] for k in _KINDS if short.startswith(k)), None)
    if kind is None or short == "JointModelSphericalZYX":
        raise ModelError(
            f"{robot.name}: joint {name!r} is a {short}, which has no counterpart in "
            "MuJoCo; lock it, or choose the plant rigid_body"
        )
    return kind


def _axis(data: Any) -> Array:
    linear, angular = np.split(np.asarray(data.S, dtype=float).reshape(6), 2)
    axis = angular if np.any(angular) else linear
    return np.asarray(axis / np.linalg.norm(axis))  # a mimic joint's S is scaled


class MujocoCoordinates:
    """Converts states and efforts between Pinocchio's coordinates and MuJoCo's.

    Velocities are related by qvel = T(q) v. T is a permutation, with a rotation block
    for a planar or free-flyer root, and with repeated columns for mimic joints. The
    force qfrc = f is a solution of tau = Tᵀ f, so that the power is the same,
    tau · v = f · qvel.

    Attributes:
        robot: The robot.
        constant_effort: Whether f depends on tau only, not on q, for a tau that is zero
            at a free-flyer root.
    """

    def __init__(
        self,
        robot: Robot,
        joints: list[Joint],
        qpos_address: Mapping[str, int],
        qvel_address: Mapping[str, int],
    ) -> None:
        """Set the joints, from `joints_of`, and their addresses in MuJoCo.

        The addresses are indices in qpos and qvel by name of the MuJoCo joint.
        """
        self.robot = robot
        self.constant_effort = all(j.kind != PLANAR for j in joints)
        scalar = [j for j in joints if j.kind in (HINGE, SLIDE)]
        own = [j for j in scalar if j.leader is None]
        self._q = np.array([j.q for j in own], dtype=int)
        self._v = np.array([j.v for j in own], dtype=int)
        self._qpos = np.array([qpos_address[j.name] for j in own], dtype=int)
        self._qvel = np.array([qvel_address[j.name] for j in own], dtype=int)
        self._special = [
            (j, qpos_address[j.mujoco_names[0]], qvel_address[j.mujoco_names[0]])
            for j in joints
            if j.kind not in (HINGE, SLIDE)
        ]
        self._followers = [
            (
                (j.scaling, j.offset),
                (qpos_address[j.name], qpos_address[j.leader.name]),
                (qvel_address[j.name], qvel_address[j.leader.name]),
            )
            for j in scalar
            if j.leader is not None
        ]
        self._placements = {
            j.index: robot.model.jointPlacements[j.index] for j in joints
        }

    @classmethod
    def of(cls, robot: Robot, model: Any) -> Self:
        """Return the coordinates of a robot in a compiled MuJoCo model.

        Joints are matched by their names; the model may contain more.
        """
        joints = joints_of(robot)
        known = {name: i for i, name in enumerate(Names(model).joints)}
        found = {}
        for name in (name for joint in joints for name in joint.mujoco_names):
            if name not in known:
                raise JointNotFoundError(
                    f"the MuJoCo model has no joint {name!r}"
                    f"{did_you_mean(name, list(known))} (it has {listing(list(known))})"
                )
            found[name] = known[name]
        return cls(
            robot,
            joints,
            {name: int(model.jnt_qposadr[joint]) for name, joint in found.items()},
            {name: int(model.jnt_dofadr[joint]) for name, joint in found.items()},
        )

    def to_mujoco(self, q: Array, v: Array, qpos: Array, qvel: Array) -> None:
        """Write the qpos and qvel of a state (q, v)."""
        qpos[self._qpos] = q[self._q]
        for joint, at, _ in self._special:
            part = q[joint.q :]
            if joint.kind == CONTINUOUS:
                qpos[at] = np.arctan2(part[1], part[0])
            elif joint.kind == SPHERICAL:
                qpos[at : at + 4] = part[[3, 0, 1, 2]]
            elif joint.kind == PLANAR:
                qpos[at : at + 3] = *part[:2], np.arctan2(part[3], part[2])
            else:
                world = self._placements[joint.index] * _pose(part)
                xyzw = pin.Quaternion(world.rotation).coeffs()
                qpos[at : at + 3] = world.translation
                qpos[at + 3 : at + 7] = xyzw[[3, 0, 1, 2]]
        for (scaling, offset), (at, leader), _ in self._followers:
            qpos[at] = scaling * qpos[leader] + offset
        self.velocity_to_mujoco(q, v, qvel)

    def velocity_to_mujoco(self, q: Array, v: Array, qvel: Array) -> None:
        """Write qvel = T(q) v."""
        self._rotated(q, v, qvel)
        for (scaling, _), _, (at, leader) in self._followers:
            qvel[at] = scaling * qvel[leader]

    def effort_to_mujoco(self, q: Array, tau: Array, qfrc: Array) -> None:
        """Write f with tau = Tᵀ f; it is zero for mimic joints, not for leaders."""
        self._rotated(q, tau, qfrc)
        for _, _, (at, _) in self._followers:
            qfrc[at] = 0.0

    def from_mujoco(self, qpos: Array, qvel: Array) -> tuple[Array, Array]:
        """Return (q, v) of MuJoCo's state, in new arrays."""
        q, v = np.empty(self.robot.nq), np.empty(self.robot.nv)
        q[self._q] = qpos[self._qpos]
        v[self._v] = qvel[self._qvel]
        for joint, at, d in self._special:
            i, k = joint.q, joint.v
            if joint.kind == CONTINUOUS:
                q[i : i + 2] = np.cos(qpos[at]), np.sin(qpos[at])
                v[k] = qvel[d]
            elif joint.kind == SPHERICAL:
                q[i : i + 4] = _unit(qpos[[at + 1, at + 2, at + 3, at]])
                v[k : k + 3] = qvel[d : d + 3]
            elif joint.kind == PLANAR:
                cos, sin = np.cos(qpos[at + 2]), np.sin(qpos[at + 2])
                q[i : i + 4] = qpos[at], qpos[at + 1], cos, sin
                v[k] = cos * qvel[d] + sin * qvel[d + 1]
                v[k + 1] = cos * qvel[d + 1] - sin * qvel[d]
                v[k + 2] = qvel[d + 2]
            else:
                wxyz = qpos[at + 3 : at + 7]
                xyzw = _unit(wxyz[[1, 2, 3, 0]])
                world = _pose(np.concatenate([qpos[at : at + 3], xyzw]))
                own = self._placements[joint.index].actInv(world)
                q[i : i + 7] = pin.SE3ToXYZQUAT(own)
                v[k : k + 3] = world.rotation.T @ qvel[d : d + 3]
                v[k + 3 : k + 6] = qvel[d + 3 : d + 6]
        return q, v

    def _rotated(self, q: Array, tangent: Array, out: Array) -> None:
        """Write a velocity or an effort in MuJoCo's order, without mimic joints."""
        out[self._qvel] = tangent[self._v]
        for joint, _, at in self._special:
            part = tangent[joint.v :]
            if joint.kind == PLANAR:
                cos, sin = q[joint.q + 2 : joint.q + 4]
                out[at] = cos * part[0] - sin * part[1]
                out[at + 1] = sin * part[0] + cos * part[1]
                out[at + 2] = part[2]
            elif joint.kind == FREE:
                own = _pose(q[joint.q :]).rotation
                rotation = self._placements[joint.index].rotation @ own
                out[at : at + 3] = rotation @ part[:3]
                out[at + 3 : at + 6] = part[3:6]
            else:
                n = 3 if joint.kind == SPHERICAL else 1
                out[at : at + n] = part[:n]


def _pose(coordinates: Array) -> pin.SE3:
    return pin.XYZQUATToSE3(coordinates[:7])


def _unit(quaternion: Array) -> Array:
    return np.asarray(quaternion / np.linalg.norm(quaternion))
