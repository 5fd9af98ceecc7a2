"""Placements of joints and frames: Jacobians, their exact rates, motion."""

from typing import NamedTuple

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices, read_only_view
from hsp_control.common.exceptions import ImmutableError
from hsp_control.engine.plans import PartCall, PartCalls


class FrameMotion(NamedTuple):
    """A frame's placement, Jacobian and motion, as one argument of a call.

    In the axes of the frame that it is relative to: the world's, unless said otherwise.
    Linear rows come before angular rows.
    """

    # J, where J v = (velocity of the origin, angular velocity), shape (6, nv)
    jacobian: Array
    jacobian_dot: Array  # J' = dJ/dt along v, exact, shape (6, nv)
    rotation: Array  # rotation matrix from the frame's axes, shape (3, 3)
    position: Array  # the frame's origin [m], shape (3,)
    velocity: Array  # J v, shape (6,) [m/s, rad/s]

    @classmethod
    def allocate(cls, nv: int) -> "FrameMotion":
        """Return zeros."""
        matrices = np.zeros((6, nv)), np.zeros((6, nv)), np.zeros((3, 3))
        return cls(*matrices, np.zeros(3), np.zeros(6))


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
    velocity: Array  # J v, shape (3,) [m/s]


class _ParentJoint(NamedTuple):
    """The joint that carries a frame."""

    J_world: Array  # the Jacobian of all joints at the world's origin, (6, nv_extended)
    J_world_dot: Array  # its rate
    R_joint: Array  # rotation of the joint, shape (3, 3)
    p_joint: Array  # origin of the joint [m], shape (3,)
    R_local: Array  # rotation of the frame in the joint, shape (3, 3)
    p_local: Array  # origin of the frame in the joint [m], shape (3,)
    columns: Indices  # the columns of J_world that move the joint
    dofs: Indices  # the indices in v of these columns


class FrameKinematics:
    """Placement and motion of a frame, in world axes, linear rows before angular rows.

    This is Pinocchio's LOCAL_WORLD_ALIGNED.

    Attributes:
        calls: Bring the attributes below up to date, if they are not.
        motion: The first five of them, as a record.
        rotation: Rotation matrix from frame axes to world axes, shape (3, 3).
        position: The frame's origin in the world [m], shape (3,).
        jacobian: J, where J v = (velocity of the origin, angular velocity), shape
            (6, nv).
        jacobian_dot: J' = dJ/dt along v, exact, shape (6, nv).
        velocity: J v, shape (6,) [m/s, rad/s].
        drift: J' v, shape (6,) [m/s², rad/s²]: the classical acceleration for v' = 0.
    """

    __slots__ = (
        "calls",
        "drift",
        "jacobian",
        "jacobian_dot",
        "motion",
        "position",
        "rotation",
        "velocity",
    )

    def __init__(
        self, model: pin.Model, world: WorldKinematics, stamp: Indices, index: int
    ) -> None:
        frame = model.frames[index]
        self.motion = motion = FrameMotion.allocate(model.nv)
        self.jacobian, self.jacobian_dot = motion.jacobian, motion.jacobian_dot
        self.rotation, self.position = motion.rotation, motion.position
        self.velocity = motion.velocity
        self.drift: Array = np.zeros(6)
        carrier = _ParentJoint(
            world.jacobian,
            world.jacobian_dot,
            *world.joint(frame.parentJoint),
            np.ascontiguousarray(frame.placement.rotation),
            frame.placement.translation.copy(),
            *joint_support(model, frame.parentJoint),
        )
        call = PartCall(
            engine.FrameKinematics,
            stamp=stamp,
            computed=np.array([-1]),
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
        (J, J_dot, _, p, velocity), calls = self._frame.supplied()
        return PointMotion(J[:3], J_dot[:3], p, velocity[:3]), calls


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
