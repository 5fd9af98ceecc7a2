"""The task of an axis of a frame that points along a direction, which may move."""

from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TaskError
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Vector3
from hsp_control.declaration.rotation import AnyRotation
from hsp_control.engine.plans import PartCall
from hsp_control.robot import RobotState
from hsp_control.robot.kinematics import FrameKinematics
from hsp_control.tasks.feedback import ErrorPart
from hsp_control.tasks.frame_task import FrameTask, place_orientation
from hsp_control.tasks.task import Drawn
from hsp_control.trajectories import (
    HoldOrientation,
    OrientationTrajectory,
)
from hsp_control.trajectories.crossfade import AnyReference


class Pointing(FrameTask, type="pointing"):
    """e = -(n_x, n_y)/(1 + n_z), the direction n of an axis in the desired frame [-].

    Two rows; the rotation about the axis itself is free. e are stereographic
    coordinates about the desired direction, |e| = tan(angle/2), in which the error
    equation is exact up to the antipode (docs/law.md). Within 12 degrees of the
    antipode |e| is saturated at 9.9: the error equation no longer holds there, but the
    axis still moves back. The acceleration is then proportional to the sine of the
    angle: an axis that rests exactly at the antipode stays there.

    J are the angular rows of the frame's Jacobian along two directions perpendicular
    to the axis.
    """

    drawn: ClassVar[tuple[Drawn, ...]] = ("direction",)

    direction: Vector3 | None = None
    """The desired direction in the world, of any length but zero [-]."""
    _: KW_ONLY
    axis: Vector3 = (0.0, 0.0, 1.0)
    """The pointing axis in the frame, of any length but zero [-]."""
    trajectory: Given[OrientationTrajectory | None, AnyRotation] = default(None)
    """Instead of `direction`, one that moves: an orientation, world ← desired frame,
    whose third axis is the desired direction [rad]. An omitted orientation is such that
    the axis points along it at the start."""

    def __post_init__(self) -> None:
        """Check axis and direction."""
        if (self.direction is None) == (self.trajectory is None):
            raise TaskError("give one of direction and trajectory")
        for name in ("axis", "direction"):
            value = getattr(self, name)
            if value is not None and not np.linalg.norm(value) > 0.0:
                raise TaskError(f"{name} must be non-zero, got [0, 0, 0]")

    @property
    def error_parts(self) -> tuple[ErrorPart, ...]:
        """The stereographic coordinates."""
        return (ErrorPart("tan of half the angle", "-", "1/s", 2),)

    def _default_name(self) -> str:
        return f"{super()._default_name()}_pointing"

    @property
    def followed(self) -> OrientationTrajectory:
        """The trajectory of a placed task, whose third axis is the direction."""
        return self._desired

    def following(self, trajectory: AnyReference) -> Self:
        """Return the task with another trajectory."""
        changes: dict[str, Any] = {"direction": None, "trajectory": trajectory}
        return replace(self, **changes)

    def facing(self, direction: Array, here: RobotState) -> Array:
        """Return the desired orientation for a direction, nearest to the frame's.

        Args:
            direction: The direction in the world, of any length but zero, shape (3,).
            here: The frame's placement.
        """
        now = here.frame(self.frame_name).rotation @ self._turn
        shortest = pin.Quaternion.FromTwoVectors(now[:, 2], direction)
        return np.asarray(shortest.toRotationMatrix() @ now)

    def _placed_at(self, here: FrameKinematics) -> dict[str, Any]:
        if self.trajectory is None:
            return {}
        turned = here.rotation @ self._turn
        return {"trajectory": place_orientation(self.trajectory, turned, None)}

    @cached_property
    def _desired(self) -> OrientationTrajectory:
        if self.direction is None:
            assert self.trajectory is not None
            return self.trajectory
        return HoldOrientation(_facing(np.asarray(self.direction)))

    @cached_property
    def _axis(self) -> Array:
        """The axis, of length 1."""
        axis = np.asarray(self.axis, dtype=float)
        return np.asarray(axis / np.linalg.norm(axis))

    @property
    def _turn(self) -> Array:
        """The shortest rotation of the frame that makes the axis its third one."""
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), self._axis)
        return np.array(turn.toRotationMatrix())

    @cached_property
    def _normals(self) -> Array:
        """Two unit vectors across the axis, right-handed with it: the rows."""
        normals = np.linalg.svd(self._axis[None, :])[2][1:]
        normals[1] *= np.sign(np.linalg.det(np.vstack([normals, self._axis])))
        return normals.copy()

    def call(self, state: RobotState) -> PartCall:
        """Return the call; see `Task.call`."""
        return PartCall(
            engine.TrackDirection,
            axis=self._axis,
            normals=self._normals,
            frame=state.frame(self.frame_name),
            desired=self._desired,
        )

    def reference_rate(self, state: RobotState) -> Array:
        """Return the part of w_d perpendicular to the axis, shape (2,) [rad/s].

        Minus the frame's rotation in its joint.
        """
        frame, w_d = state.frame(self.frame_name), self._desired.sample(state.t)
        rate = w_d.angular_velocity - frame.own_velocity[3:]
        return self._normals @ frame.rotation.T @ rate

    def measure(self, state: RobotState) -> tuple[Array, Array]:
        """Return desired and actual direction in the world, unit vectors (3,)."""
        desired = self._desired.sample(state.t).rotation[:, 2].copy()
        return desired, state.frame(self.frame_name).rotation @ self._axis


def _facing(direction: Array) -> Array:
    """Return a rotation whose third axis is a direction."""
    length = float(np.linalg.norm(direction))
    x, y = np.linalg.svd(direction[None, :] / length)[2][1:]
    rotation = np.column_stack([x, y, direction / length])
    rotation[:, 0] *= np.sign(np.linalg.det(rotation))
    return rotation
