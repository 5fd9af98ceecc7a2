"""Trajectories of a pose: the abstract one, composed, constant, and along a screw."""

from abc import ABC, abstractmethod
from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import NamedTuple, Self, TypeAlias

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration import Part
from hsp_control.declaration.given import Given, default
from hsp_control.declaration.quantities import Number, Positive, Vector3, numbers
from hsp_control.declaration.rotation import AnyRotation, Rotation, matrix_of
from hsp_control.engine.plans import TIME, PartCall, PartCalls, implemented_by
from hsp_control.engine.rotations import jlog3, log3
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import Course
from hsp_control.trajectories.hold import Hold, HoldOrientation
from hsp_control.trajectories.orientation import (
    OrientationSample,
    OrientationTrajectory,
)
from hsp_control.trajectories.trajectory import (
    Trajectory,
    TrajectorySample,
    write_sample,
)


class PoseSample(NamedTuple):
    """x, x', x'', R, ω and ω': a pose trajectory at one time, in world axes."""

    position: TrajectorySample
    """The body's origin, of dimension 3 [m, m/s, m/s²]."""
    orientation: OrientationSample
    """Its rotation, angular velocity and angular acceleration."""

    @classmethod
    def allocate(cls) -> "PoseSample":
        """Return a sample at the identity and at rest, for `PoseTrajectory.sample`."""
        memory = np.zeros((8, 3))
        memory[3, 0] = memory[4, 1] = memory[5, 2] = 1.0
        return cls.over(memory)

    @classmethod
    def over(cls, memory: Array) -> "PoseSample":
        """Return a sample whose arrays are views of ``memory``; memory (8, 3)."""
        return cls(
            TrajectorySample(memory[0], memory[1], memory[2]),
            OrientationSample(memory[3:6], memory[6], memory[7]),
        )


AnyPose: TypeAlias = ArrayLike | pin.SE3
"""What a pose may be given as: see `HoldPose`."""


class PoseTrajectory(Part, ABC, family="poses", error=TrajectoryError):
    """M(t) = (R(t), x(t)) in SE(3); a value, defined at every t.

    Body to world; x is the body's origin [m], all rates are in world axes. A subclass
    declares its parameters as fields and implements `sample`; it may override `calls`,
    see `Trajectory.calls`. If it can be relative to the robot's start, it overrides
    `relative` and `anchored`.
    """

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return False

    def anchored(self, start: pin.SE3) -> "PoseTrajectory":
        """Return this trajectory for a robot that starts in a pose, body to world."""
        return self

    @property
    def course(self) -> Course | None:
        """The interval in which it moves; see `Trajectory.course`."""
        return None

    @abstractmethod
    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t with its first two derivatives.

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """

    def _output(self, out: PoseSample | None) -> PoseSample:
        """Return ``out``, or a new sample if it is None."""
        if out is None:
            return PoseSample.allocate()
        return checks.output(out, PoseSample)

    def calls(self, out: PoseSample) -> PartCalls:
        """Return the calls that write ``out`` at a time; see `Trajectory.calls`."""
        return [PartCall(write_sample, sampler=self.sample, out=out, t=TIME)]

    def supplied(self) -> tuple[PoseSample, PartCalls]:
        """Return its sample as an argument of a call; see `planned`."""
        desired = PoseSample.over(np.zeros((8, 3)))
        return desired, self.calls(desired)


class ComposedPose(PoseTrajectory, type="composed"):
    """M(t) = (R(t), x(t)), with separate trajectories x and R."""

    position: Given[Trajectory, ArrayLike] = default(Hold())
    """x(t) [m]; held where the robot starts by default."""
    orientation: Given[OrientationTrajectory, AnyRotation] = default(HoldOrientation())
    """R(t), body to world; held as the robot starts by default."""

    def __post_init__(self) -> None:
        """Check the dimension of the position."""
        if not self.position.relative and self.position.dimension != 3:
            raise TrajectoryError(
                f"position has dimension {self.position.dimension}; "
                "the origin of a pose needs dimension 3"
            )

    @property
    def relative(self) -> bool:
        """Whether one of them depends on the robot's start."""
        return self.position.relative or self.orientation.relative

    @property
    def course(self) -> Course | None:
        """The course of the position, which has the length, or of the orientation."""
        moves, turns = self.position.course, self.orientation.course
        if self.position.constant:
            return turns
        if moves is None or turns is None or moves.repeats or turns.repeats:
            return moves
        return Course(np.unique(np.concatenate([moves.knots, turns.knots])), False)

    def anchored(self, start: pin.SE3) -> "ComposedPose":
        """Return both for a robot that starts in a pose; see `PoseTrajectory`."""
        return ComposedPose(
            self.position.anchored(start.translation),
            self.orientation.anchored(start.rotation),
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        out = self._output(out)
        self.position.sample(t, out.position)
        self.orientation.sample(t, out.orientation)
        return out

    def calls(self, out: PoseSample) -> PartCalls:
        """Return the calls of both; see `Trajectory.calls`."""
        orientation = self.orientation.calls(out.orientation)
        return [*self.position.calls(out.position), *orientation]


class HoldPose(PoseTrajectory, type="hold_pose"):
    """M(t) = M0, a constant pose."""

    position: Vector3 | None = None
    """The origin in the world, shape (3,) [m]; where the robot starts by default."""
    rotation: Rotation | None = None
    """The orientation, body to world: roll, pitch and yaw [rad], a quaternion or a
    matrix [-]; that in which the robot starts by default."""

    @classmethod
    def of_value(cls, value: object) -> Self | None:
        """Return the pose of a pin.SE3, of x, y, z and a quaternion, or of a matrix."""
        if isinstance(value, pin.SE3):
            return cls(value.translation, value.rotation)
        given = numbers(value)
        if given is not None and given.shape == (7,):
            return cls(given[:3], given[3:])
        if given is not None and given.shape == (4, 4):
            return cls(given[:3, 3], given[:3, :3])
        return None

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return self.position is None or self.rotation is None

    def anchored(self, start: pin.SE3) -> "HoldPose":
        """Return the pose, by default that of the robot's start."""
        return HoldPose(
            start.translation if self.position is None else self.position,
            start.rotation if self.rotation is None else self.rotation,
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose and zero rates; see `PoseTrajectory.sample`."""
        return self._parts.sample(t, out)

    def calls(self, out: PoseSample) -> PartCalls:
        """Write ``out`` once, and return no calls."""
        return self._parts.calls(out)

    @cached_property
    def _parts(self) -> ComposedPose:
        return ComposedPose(Hold(self.position), HoldOrientation(self.rotation))


class ScrewInterpolation(PoseTrajectory, type="screw"):
    """M(t) = M0 exp6(s log6(M0⁻¹ M1)), with s the `smooth_step` from rest to rest.

    The body rotates about one fixed axis and moves along it, so that its origin follows
    a helix. For a straight line of the origin use `ComposedPose` with a `Line` and an
    `OrientationPath`. C²; it rests at M0 before and at M1 after.
    """

    position: Vector3
    """Final position of the origin in the world, shape (3,) [m]."""
    rotation: Rotation
    """Final orientation, body to world: roll, pitch and yaw [rad], a quaternion or a
    matrix [-]."""
    duration: Positive
    """T [s]."""
    _: KW_ONLY
    start_time: Number = 0.0
    """Time at which the motion begins [s]."""
    start_position: Vector3 | None = None
    """Position at the start, shape (3,) [m]; where the robot starts by default."""
    start_rotation: Rotation | None = None
    """Orientation at the start, as `rotation` [rad or -]; that in which the robot
    starts by default."""

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return self.start_position is None or self.start_rotation is None

    def anchored(self, start: pin.SE3) -> "ScrewInterpolation":
        """Return the motion from the given start; see `PoseTrajectory.anchored`."""
        position, rotation = self.start_position, self.start_rotation
        return replace(
            self,
            start_position=start.translation if position is None else position,
            start_rotation=start.rotation if rotation is None else rotation,
        )

    @property
    def course(self) -> Course:
        """From its start to its end."""
        times = [self.start_time, self.start_time + self.duration]
        return Course(np.array(times), False)

    @cached_property
    def _ends(self) -> tuple[Array, Array]:
        """Positions and rotations at both ends, shapes (2, 3) and (2, 3, 3)."""
        if self.start_position is None or self.start_rotation is None:
            raise TrajectoryError(
                "ScrewInterpolation begins where the robot starts, which only a "
                "controller knows; give start_position and start_rotation"
            )
        positions = np.array([self.start_position, self.position], dtype=float)
        return positions, np.stack(
            [matrix_of(self.start_rotation), matrix_of(self.rotation)]
        )

    @cached_property
    def _call(self) -> PartCall:
        positions, rotations = self._ends
        a, b = _screw(positions, rotations)
        return PartCall(
            engine.Screw,
            start_time=self.start_time,
            duration=self.duration,
            positions=positions,
            rotations=rotations,
            a=a,
            b=b,
        )

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        out = self._output(out)
        engine.Screw(**self._call.arguments, out=out)(float(t))
        return out

    def calls(self, out: PoseSample) -> PartCalls:
        """Return the calls that write ``out``; see `Trajectory.calls`."""
        if implemented_by(self, "calls", "sample") == "sample":  # in a derived class
            return super().calls(out)
        return [self._call.given(out=out, t=TIME)]


def _screw(positions: Array, rotations: Array) -> tuple[Array, Array]:
    """Return a and b, shapes (3,), in the world frame.

    (a, b) is the constant twist that moves the body from start to end in one second: a
    is the rotation vector [rad], b the velocity of the origin at the start [m];
    V(a) b = p1 - p0, with the left Jacobian V(y) = Jexp(-y).
    """
    a = rotations[0] @ log3(rotations[0].T @ rotations[1])
    return a, jlog3(-a) @ (positions[1] - positions[0])
