"""Orientations that move: the abstract one, from waypoint to waypoint, a spin."""

from abc import ABC
from dataclasses import KW_ONLY, replace
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.common.errors import TrajectoryError
from hsp_control.declaration import Part
from hsp_control.declaration.quantities import Number, Vector, Vector3
from hsp_control.declaration.rotation import Rotation, Rotations, matrix_of
from hsp_control.engine.plans import PartCall, PartCalls
from hsp_control.engine.rotations import log3
from hsp_control.trajectories import checks
from hsp_control.trajectories.arc_length import Course
from hsp_control.trajectories.trajectory import calls_of_sample, sampled


class OrientationSample(NamedTuple):
    """R(t), ω(t) and ω'(t): an orientation trajectory at one time."""

    rotation: Array
    """R(t), body to world, shape (3, 3)."""
    angular_velocity: Array
    """ω(t) in the world frame, R' = [ω]× R, shape (3,) [rad/s]."""
    angular_acceleration: Array
    """ω'(t) in the world frame, shape (3,) [rad/s²]."""

    @classmethod
    def allocate(cls) -> "OrientationSample":
        """Return a sample at the identity, for `OrientationTrajectory.sample`."""
        return cls(np.eye(3), np.zeros(3), np.zeros(3))


class OrientationTrajectory(Part, ABC, family="orientations", error=TrajectoryError):
    """R(t) in SO(3) with ω(t) and ω'(t); a value, defined at every t.

    R is body to world, ω is in world axes. A subclass declares its parameters as fields
    and implements `sample` or `call`, as described in `Trajectory`. A motion of
    finite duration rests at its first orientation before the start and at its last
    orientation after the end.

    A field `rotation` that is omitted means the orientation in which the robot starts.
    Such a trajectory cannot be sampled; `anchored` returns it with that orientation.

    Attributes:
        constant: Whether it rests at one orientation for ever.
    """

    constant: ClassVar[bool] = False

    @property
    def relative(self) -> bool:
        """Whether it depends on the robot's start."""
        return getattr(self, "rotation", self) is None

    def anchored(self, start: ArrayLike) -> "OrientationTrajectory":
        """Return this trajectory for a robot that starts in an orientation.

        Args:
            start: The orientation, body to world; a matrix of shape (3, 3), or as in
                `Rotation`.
        """
        if not self.relative:
            return self
        rotated: dict[str, Any] = {"rotation": start}
        return replace(self, **rotated)

    @property
    def course(self) -> Course | None:
        """The interval in which it rotates; see `Trajectory.course`."""
        return None

    def call(self) -> PartCall:
        """Return a kind of call with its arguments; see `Trajectory.call`."""
        raise TypeError(f"{type(self).__name__} implements neither call nor sample")

    def sample(
        self, t: float, out: OrientationSample | None = None
    ) -> OrientationSample:
        """Return R(t), ω(t) and ω'(t), shapes (3, 3), (3,) and (3,).

        Args:
            t: Time [s].
            out: The sample to write into; None: a new one, which shares no memory with
                the trajectory.

        Returns:
            ``out``, or the new sample.
        """
        sample: OrientationSample = sampled(self, t, self._output(out))
        return sample

    def calls(self, out: OrientationSample) -> PartCalls:
        """Return the calls that write ``out`` at a time; see `Trajectory.calls`."""
        return calls_of_sample(self, self._output(out))

    def supplied(self) -> tuple[OrientationSample, PartCalls]:
        """Return its sample as an argument of a call; see `planned`."""
        sample = OrientationSample.allocate()
        return sample, self.calls(sample)

    def _output(self, out: OrientationSample | None) -> OrientationSample:
        """Return ``out``, or a new sample if it is None."""
        if self.relative:
            raise TrajectoryError(
                f"{type(self).__name__} has no rotation: it is that in which the robot "
                "starts, which only a controller knows; give rotation, or `anchored`"
            )
        if out is None:
            return OrientationSample.allocate()
        return checks.output(out, OrientationSample)


class OrientationPath(OrientationTrajectory, type="path"):
    """R(t) = exp(s a_i) R_i from t_i to t_{i+1}, s the `smooth_step`.

    a_i = R_i log(R_iᵀ R_{i+1}) is the shortest rotation to the next waypoint, in the
    world frame. For an angle of π its sense is not unique: add a waypoint in between.
    The body rests at every waypoint, before the first and after the last; the motion is
    C².
    """

    rotations: Rotations
    """R_i, at least two, body to world: each as roll, pitch and yaw [rad], as a
    quaternion or as a matrix [-]."""
    times: Vector
    """t_i, increasing, shape (m,) [s]."""

    def __post_init__(self) -> None:
        """Check the waypoints and their times."""
        checks.waypoint_times(self.times, len(self._matrices))

    @property
    def course(self) -> Course:
        """From the first orientation to the last."""
        return Course(np.array(self.times, dtype=float), False)

    @cached_property
    def _matrices(self) -> Array:
        return np.array([matrix_of(each) for each in np.asarray(self.rotations)])

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        R = self._matrices
        turns = np.zeros((len(R), 3))
        for i in range(len(R) - 1):
            turns[i] = R[i] @ log3(R[i].T @ R[i + 1])
        return PartCall(
            engine.OrientationPath,
            times=np.asarray(self.times),
            rotations=R,
            turns=turns,
        )


class Spin(OrientationTrajectory, type="spin"):
    """R(t) = exp(t ω) R0 with ω = rate · axis in the world frame, for all t."""

    axis: Vector3
    """Direction of the axis in the world, of any length but zero, shape (3,) [-]."""
    rate: Number
    """Angular rate about the axis [rad/s]."""
    _: KW_ONLY
    rotation: Rotation | None = None
    """R0, the orientation at t = 0, body to world: roll, pitch and yaw [rad], a
    quaternion or a matrix [-]; that in which the robot starts by default."""

    def __post_init__(self) -> None:
        """Check that the axis is not zero."""
        checks.direction(self.axis, "axis")

    @property
    def course(self) -> Course:
        """One turn, repeated."""
        return Course.turn(self.rate)

    def call(self) -> PartCall:
        """Return the call; see `Trajectory.call`."""
        return self._call

    @cached_property
    def _call(self) -> PartCall:
        assert self.rotation is not None
        omega = self.rate * checks.direction(self.axis, "axis")
        return PartCall(
            engine.Spin,
            angular_velocity=np.asarray(omega),
            start=matrix_of(self.rotation),
        )
