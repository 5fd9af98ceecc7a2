"""Placements of joints and frames: Jacobians, their exact rates, motion."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices, read_only_view
from hsp_control.common.errors import ImmutableError
from hsp_control.engine.plans import PartCall, PartCalls


class FrameMotion(NamedTuple):
    """A frame's placement, Jacobian and motion, as one argument of a call.

    In the axes of the frame to which it is relative: the world's by default.
    Linear rows come before angular rows.
    """

    # J, where J v = (velocity of the origin, angular velocity), shape (6, nv)
    jacobian: Array
    jacobian_dot: Array  # J' = dJ/dt along v, exact, shape (6, nv)
    rotation: Array  # rotation matrix from the frame's axes, shape (3, 3)
    position: Array  # the frame's origin [m], shape (3,)
    velocity: Array  # of the origin, and angular, shape (6,) [m/s, rad/s]
    # velocity - J v, and its rate: zero but for a frame that moves in its joint, (6,)
    own_velocity: Array
    own_acceleration: Array

    @classmethod
    def allocate(cls, nv: int) -> "FrameMotion":
        """Return zeros."""
        matrices = np.zeros((6, nv)), np.zeros((6, nv)), np.zeros((3, 3))
        return cls(*matrices, np.zeros(3), *np.zeros((3, 6)))


class WorldKinematics(NamedTuple):
    """Placements and Jacobians of all joints, from which all others follow."""

    # of the joints, with the world: R, column by column, and the origin [m], shape
    # (njoints, 12)
    placements: Array
    # Pinocchio's J, in world axes at the world's origin, column by column, shape
    # (6, nvExtended): see `joint_support`
    jacobian: Array
    jacobian_dot: Array  # its time derivative, shape (6, nvExtended)
    v: Array  # the velocity, shape (nv,)

    @classmethod
    def allocate(cls, model: pin.Model, v: Array) -> "WorldKinematics":
        """Return zeros, and a velocity."""
        J, J_dot = (np.zeros((6, model.nvExtended), order="F") for _ in range(2))
        return cls(np.zeros((model.njoints, 12)), J, J_dot, v)

    def joint(self, index: int) -> tuple[Array, Array]:
        """Return R, shape (3, 3), and the origin [m], shape (3,), as views."""
        row = self.placements[index]
        return row[:9].reshape(3, 3).T, row[9:]


class PointMotion(NamedTuple):
    """The part of a `FrameMotion` that a point without axes has."""

    jacobian: Array  # shape (3, nv)
    jacobian_dot: Array  # shape (3, nv)
    position: Array  # shape (3,) [m]
    velocity: Array  # shape (3,) [m/s]
    own_acceleration: Array  # shape (3,) [m/s²]; see `FrameMotion`


class LocalMotion(NamedTuple):
    """A frame's motion in the joint that carries it, in the axes of the joint."""

    R_local: Array  # rotation of the frame in the joint, shape (3, 3)
    p_local: Array  # origin of the frame in the joint [m], shape (3,)
    p_local_dot: Array  # its velocity [m/s]
    p_local_ddot: Array  # its acceleration [m/s²]
    w_local: Array  # angular velocity [rad/s]
    w_local_dot: Array  # angular acceleration [rad/s²]

    @classmethod
    def fixed(cls, placement: pin.SE3) -> "LocalMotion":
        """Return the motion of a frame that is fixed in its joint."""
        R = np.ascontiguousarray(placement.rotation)
        # not rows of one array: copies would be aligned otherwise to a packet
        rest = (np.zeros(3) for _ in range(4))
        return cls(R, placement.translation.copy(), *rest)


class _ParentJoint(NamedTuple):
    """The joint that carries a frame."""

    J_world: Array  # the Jacobian of all joints at the world's origin, (6, nv_extended)
    J_world_dot: Array  # its rate
    R_joint: Array  # rotation of the joint, shape (3, 3)
    p_joint: Array  # origin of the joint [m], shape (3,)
    R_local: Array  # those of a `LocalMotion`
    p_local: Array
    p_local_dot: Array
    p_local_ddot: Array
    w_local: Array
    w_local_dot: Array
    columns: Indices  # the columns of J_world that move the joint
    dofs: Indices  # the indices in v of these columns


class FrameKinematics:
    """Placement and motion of a frame, in world axes, linear rows before angular rows.

    This is Pinocchio's LOCAL_WORLD_ALIGNED.

    Attributes:
        calls: Bring the attributes below up to date, if they are not.
        motion: All but the drift, as a record.
        rotation: Rotation matrix from frame axes to world axes, shape (3, 3).
        position: The frame's origin in the world [m], shape (3,).
        jacobian: J, where J v = (velocity of the origin, angular velocity), shape
            (6, nv).
        jacobian_dot: J' = dJ/dt along v, exact, shape (6, nv).
        velocity: J v, shape (6,) [m/s, rad/s]; while a change moves the frame in its
            joint plus ``own_velocity``.
        own_velocity: The part of that motion in the velocity, shape (6,).
        own_acceleration: Its part of the acceleration, beside J v' + J' v, shape (6,)
            [m/s², rad/s²].
        drift: The classical acceleration for v' = 0, shape (6,) [m/s², rad/s²]: J' v.
    """

    __slots__ = (
        "_computed",
        "calls",
        "drift",
        "jacobian",
        "jacobian_dot",
        "motion",
        "own_acceleration",
        "own_velocity",
        "position",
        "rotation",
        "velocity",
    )
    jacobian: Array
    jacobian_dot: Array
    rotation: Array
    position: Array
    velocity: Array
    own_velocity: Array
    own_acceleration: Array

    def __init__(
        self,
        model: pin.Model,
        world: WorldKinematics,
        stamp: Indices,
        joint: int,
        local: LocalMotion,
    ) -> None:
        self.motion = motion = FrameMotion.allocate(model.nv)
        for name, array in zip(FrameMotion._fields, motion, strict=True):
            setattr(self, name, array)
        self.drift: Array = np.zeros(6)
        self._computed = np.array([-1])
        carrier = _ParentJoint(
            world.jacobian,
            world.jacobian_dot,
            *world.joint(joint),
            *local,
            *joint_support(model, joint),
        )
        call = PartCall(
            engine.FrameKinematics,
            stamp=stamp,
            computed=self._computed,
            carrier=carrier,
            v=world.v,
            motion=motion,
            drift=self.drift,
        )
        self.calls: PartCalls = [call]

    def __setattr__(self, name: str, value: object) -> None:
        if hasattr(self, name):
            raise ImmutableError(
                f"frame.{name} cannot be assigned: native calls go on with the array "
                "that was there; copy it, and change the copy"
            )
        super().__setattr__(name, value)

    def forget(self) -> None:
        """Compute it anew, also for the present state."""
        self._computed[0] = -1

    def supplied(self) -> tuple[FrameMotion, PartCalls]:
        """Return the motion as an argument of a call; see `planned`."""
        return self.motion, self.calls

    @property
    def point(self) -> "FramePoint":
        """The frame's origin, as an argument of a call."""
        return FramePoint(self)


class FramePoint:
    """The origin of a frame, without its axes."""

    def __init__(self, frame: FrameKinematics) -> None:
        self._frame = frame

    def supplied(self) -> tuple[PointMotion, PartCalls]:
        """Return the origin's motion as an argument of a call; see `planned`."""
        motion, calls = self._frame.supplied()
        J, J_dot = motion.jacobian[:3], motion.jacobian_dot[:3]
        velocity, acceleration = motion.velocity[:3], motion.own_acceleration[:3]
        return PointMotion(J, J_dot, motion.position, velocity, acceleration), calls


class ShownFrame(FrameKinematics):
    """A frame whose arrays can be read, but not written."""

    __slots__ = ("_own",)

    def __init__(self, own: FrameKinematics) -> None:
        self._own, self.calls = own, own.calls
        self.motion = FrameMotion(*map(read_only_view, own.motion))
        for name, view in zip(FrameMotion._fields, self.motion, strict=True):
            setattr(self, name, view)
        self.drift = read_only_view(own.drift)

    def supplied(self) -> tuple[FrameMotion, PartCalls]:
        """Return the motion as an argument of a call; see `planned`."""
        return self._own.supplied()


class Term(NamedTuple):
    """An array, and the calls that bring it up to date."""

    value: Array
    calls: PartCalls

    def supplied(self) -> tuple[Array, PartCalls]:
        """Return the array as an argument of a call; see `planned`."""
        return self.value, self.calls


def joint_support(model: pin.Model, joint: int) -> tuple[Indices, Indices]:
    """Return the columns of Pinocchio's J that move a joint, and their indices in v."""
    columns: list[int] = []
    dofs: list[int] = []
    for index in list(model.supports[joint])[1:]:  # without the universe
        part = model.joints[index]
        width = part.nvExtended
        columns.extend(range(part.idx_vExtended, part.idx_vExtended + width))
        dofs.extend(range(part.idx_v, part.idx_v + width))
    return np.array(columns, dtype=np.int64), np.array(dofs, dtype=np.int64)
