"""The screw motion from one pose to another."""

from dataclasses import KW_ONLY, replace
from functools import cached_property

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import TrajectoryError
from hsp_control.common.kernels import kernel
from hsp_control.common.rotations import compose_back, jlog3, log3, stumpff, turn
from hsp_control.declaration.quantities import Number, Positive, Vector3
from hsp_control.declaration.rotation import Rotation, matrix_of
from hsp_control.trajectories.pose import PoseSample, PoseTrajectory
from hsp_control.trajectories.timing import smooth_step


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
        """Whether it depends on where the robot starts."""
        return self.start_position is None or self.start_rotation is None

    def anchored(self, start: pin.SE3) -> "ScrewInterpolation":
        """Return the motion from the given start; see `PoseTrajectory.anchored`."""
        position, rotation = self.start_position, self.start_rotation
        return replace(
            self,
            start_position=start.translation if position is None else position,
            start_rotation=start.rotation if rotation is None else rotation,
        )

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
    def _screw(self) -> Array:
        return _screw(*self._ends)

    def sample(self, t: float, out: PoseSample | None = None) -> PoseSample:
        """Return the pose at time t; see `PoseTrajectory.sample`."""
        if out is None:
            out = PoseSample.allocate()
        positions, rotations = self._ends
        s, s_dot, s_ddot = smooth_step(float(t), self.start_time, self.duration)
        if 0.0 < s < 1.0:
            p, R = positions[0], rotations[0]
            _advance(s, s_dot, s_ddot, p, R, self._screw, *out.position, *out[1])
        else:
            end = int(s)
            out.position.position[:] = positions[end]
            out.orientation.rotation[:] = rotations[end]
            for rate in (*out.position[1:], *out.orientation[1:]):
                rate.fill(0.0)
        return out


def _screw(positions: Array, rotations: Array) -> Array:
    """Return a, b, a × b and a (a·b), shape (4, 3), in the world frame.

    (a, b) is the constant twist that moves the body from start to end in one second: a
    is the rotation vector [rad], b the velocity of the origin at the start [m];
    V(a) b = p1 - p0, with the left Jacobian V(y) = Jexp(-y).
    """
    body, R, V_inverse = np.empty(3), np.empty((3, 3)), np.empty((3, 3))
    compose_back(rotations[0], rotations[1], R)
    log3(R, body)
    a = rotations[0] @ body
    jlog3(-a, V_inverse)
    b = V_inverse @ (positions[1] - positions[0])
    return np.stack([a, b, np.cross(a, b), a * (a @ b)])


@kernel
def _advance(
    s: float,
    s_dot: float,
    s_ddot: float,
    start_position: Array,
    start_rotation: Array,
    screw: Array,
    position: Array,
    velocity: Array,
    acceleration: Array,
    rotation: Array,
    angular_velocity: Array,
    angular_acceleration: Array,
) -> None:
    """Write the pose exp(s a) R0, p0 + V(s a) s b, and its rates.

    p' = s' f and p'' = s'' f + s'² a × f with f = exp(s a) b. The rows of ``screw`` are
    those of `_screw`.
    """
    a, b, a_cross_b, along = screw[0], screw[1], screw[2], screw[3]
    a_squared = a[0] * a[0] + a[1] * a[1] + a[2] * a[2]
    c0, c1, c2, c3, _, _ = stumpff(s * s * a_squared)
    turn(start_rotation, a, s, rotation)
    for i in range(3):
        offset = s * (c1 * b[i] + s * c2 * a_cross_b[i] + s * s * c3 * along[i])
        f = c0 * b[i] + s * c1 * a_cross_b[i] + s * s * c2 * along[i]
        a_cross_f = c0 * a_cross_b[i] + s * c1 * (along[i] - a_squared * b[i])
        position[i] = start_position[i] + offset
        velocity[i] = s_dot * f
        acceleration[i] = s_ddot * f + s_dot * s_dot * a_cross_f
        angular_velocity[i] = s_dot * a[i]
        angular_acceleration[i] = s_ddot * a[i]
