"""The contact-aided invariant extended Kalman filter.

R. Hartley, M. Ghaffari, R. Eustice, J. Grizzle, "Contact-aided invariant extended
Kalman filtering for robot state estimation", Int. J. Robotics Research 39(4), 2020. The
state is the pose of an inertial measurement unit, its velocity, and the points where
the robot touches the world, one element X of the group SE_{n+2}(3),

    X = (R, v, p, d_1, ..., d_n),        and the biases b_g and b_a.

The filter follows the right-invariant error X̂ X⁻¹ = exp(ξ) and ζ = b̂ - b:

    R̂ = exp(ξ_R) R,    v̂ = exp(ξ_R) v + Jl ξ_v,    the same for p and each d.

The unit's readings ω and f drive it over a period h, with ω̂ = ω - b_g, f̂ = f - b_a:

    R⁺ = R exp(ω̂ h),    v⁺ = v + (R f̂ + g) h,    p⁺ = p + v h + ½ (R f̂ + g) h²,

and d is constant. To first order the error then propagates exactly as

    ξ_R⁺ = ξ_R + B ζ_g,                                  B = -R Jl(ω̂ h) h
    ξ_v⁺ = ξ_v + h g×ξ_R + v⁺×B ζ_g - h R ζ_a
    ξ_p⁺ = ξ_p + h ξ_v + ½ h² g×ξ_R + p⁺×B ζ_g - ½ h² R ζ_a
    ξ_d⁺ = ξ_d + d×B ζ_g,

which depends on the estimate only through the biases: this is why this error is chosen.
The kinematics of the legs measure the position of a point relative to the unit,
y = Rᵀ(d - p) + n. The innovation in world axes is linear in the error, whatever the
estimate is:

    R̂ y + p̂ - d̂ = ξ_p - ξ_d + R̂ n.

The heading and the position of the robot are not observable: their errors stay, and
grow.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.engine.rotations import exp3, jexp3

PointName: TypeAlias = tuple[str, int]
"""A contact, and the index of its point."""
ROTATION, VELOCITY, POSITION = slice(0, 3), slice(3, 6), slice(6, 9)
"""Indices of ξ_R, ξ_v and ξ_p in the error."""
GYROSCOPE, ACCELEROMETER = slice(9, 12), slice(12, 15)
"""Indices of ζ_g and ζ_a in the error; the points follow."""
FIXED = 15
"""Dimension of the error without points."""


@dataclass(frozen=True)
class Densities:
    """Spectral densities of the noise that drives the filter.

    Attributes:
        gyroscope: Of the angular velocity [rad/s/√Hz].
        accelerometer: Of the specific force [m/s²/√Hz].
        gyroscope_walk: Of the rate of its bias [rad/s²/√Hz].
        accelerometer_walk: Of the rate of its bias [m/s³/√Hz].
        slip: Of the velocity of a point that touches the world [m/s/√Hz].
    """

    gyroscope: float
    accelerometer: float
    gyroscope_walk: float
    accelerometer_walk: float
    slip: float


class InvariantFilter:
    """The filter of one robot in one run; points come and go by their names.

    Attributes:
        rotation: R̂, from the unit's axes to the world's, shape (3, 3).
        velocity: v̂ in the world, shape (3,) [m/s].
        position: p̂ in the world, shape (3,) [m].
        points: d̂ of each point in the world, shape (n, 3) [m].
        names: The names of the points, in order.
        gyroscope_bias: b̂_g, shape (3,) [rad/s].
        accelerometer_bias: b̂_a, shape (3,) [m/s²].
        covariance: P of (ξ_R, ξ_v, ξ_p, ζ_g, ζ_a, ξ_d1, ...), shape (15 + 3 n, ...).
    """

    def __init__(
        self,
        rotation: Array,
        velocity: Array,
        position: Array,
        covariance: Array,
        densities: Densities,
        gravity: Array,
    ) -> None:
        """Begin at an estimate without points, and without biases."""
        self.rotation: Array = rotation.copy()
        self.velocity: Array = velocity.copy()
        self.position: Array = position.copy()
        self.gyroscope_bias: Array = np.zeros(3)
        self.accelerometer_bias: Array = np.zeros(3)
        self.points: Array = np.zeros((0, 3))
        self.names: list[PointName] = []
        self.covariance: Array = covariance.copy()
        self._densities, self._gravity = densities, gravity.copy()

    # -- prediction -------------------------------------------------------------------

    def predict(self, angular_velocity: Array, specific_force: Array, h: float) -> None:
        """Propagate over a period, with the unit's readings."""
        turn, R = h * (angular_velocity - self.gyroscope_bias), self.rotation
        force = R @ (specific_force - self.accelerometer_bias)
        # The left Jacobian is the right one of the opposite.
        B = -h * R @ jexp3(-turn)
        acceleration = force + self._gravity
        self.position = self.position + h * self.velocity + 0.5 * h * h * acceleration
        self.velocity = self.velocity + h * acceleration
        transition = self._transition(R, B, h)
        self.rotation = orthonormal(R @ exp3(turn))
        self.covariance = transition @ self.covariance @ transition.T + self._noise(
            transition, h
        )

    def _transition(self, R: Array, B: Array, h: float) -> Array:
        """Return the transition matrix of the error; see the head of the file."""
        Phi = np.eye(len(self.covariance))
        down = skew(self._gravity)
        Phi[ROTATION, GYROSCOPE] = B
        Phi[VELOCITY, ROTATION] = h * down
        Phi[VELOCITY, GYROSCOPE] = skew(self.velocity) @ B
        Phi[VELOCITY, ACCELEROMETER] = -h * R
        Phi[POSITION, ROTATION] = 0.5 * h * h * down
        Phi[POSITION, VELOCITY] = h * np.eye(3)
        Phi[POSITION, GYROSCOPE] = skew(self.position) @ B
        Phi[POSITION, ACCELEROMETER] = -0.5 * h * h * R
        for k, point in enumerate(self.points):
            Phi[_rows(k), GYROSCOPE] = skew(point) @ B
        return Phi

    def _noise(self, transition: Array, h: float) -> Array:
        """Return the growth of P in a period: white noise enters where a bias does."""
        n = self._densities
        gyro = transition[:, GYROSCOPE].copy()
        accelerometer = transition[:, ACCELEROMETER].copy()
        gyro[GYROSCOPE] = accelerometer[ACCELEROMETER] = 0.0
        added = (n.gyroscope**2 / h) * gyro @ gyro.T
        added += (n.accelerometer**2 / h) * accelerometer @ accelerometer.T
        diagonal = added.ravel()[:: len(added) + 1]  # a view
        diagonal[GYROSCOPE] += h * n.gyroscope_walk**2
        diagonal[ACCELEROMETER] += h * n.accelerometer_walk**2
        diagonal[FIXED:] += h * n.slip**2
        return np.asarray(added)

    # -- points -----------------------------------------------------------------------

    def move(self, displacements: Array) -> None:
        """Move the points by known displacements, such as rolling."""
        self.points = self.points + displacements

    def add(self, names: Sequence[PointName], seen: Array, noise: Array) -> None:
        """Add points at their places by the kinematics.

        Their errors are those of the unit's position and of the measurement:
        ξ_d = ξ_p + R̂ n.
        """
        size, k = len(self.covariance), len(names)
        grow = np.zeros((size + 3 * k, size))
        grow[:size] = np.eye(size)
        for row in range(size, size + 3 * k, 3):
            grow[row : row + 3, POSITION] = np.eye(3)
        self.covariance = grow @ self.covariance @ grow.T
        self.covariance[size:, size:] += turned_covariance(self.rotation, noise)
        self.points = np.vstack([self.points, self.position + seen @ self.rotation.T])
        self.names = [*self.names, *names]

    def drop(self, names: Sequence[PointName]) -> None:
        """Remove points that do not touch the world any more."""
        kept = [k for k, name in enumerate(self.names) if name not in set(names)]
        rows = [*range(FIXED), *(FIXED + 3 * k + i for k in kept for i in range(3))]
        self.covariance = self.covariance[np.ix_(rows, rows)]
        self.points = self.points[kept]
        self.names = [self.names[k] for k in kept]

    # -- correction -------------------------------------------------------------------

    def correct(self, seen: Array, noise: Array) -> None:
        """Correct the estimate by the kinematic measurements of all points."""
        if not self.names:
            return
        innovation = (seen @ self.rotation.T + self.position - self.points).ravel()
        P, H = self.covariance, self.observation()
        PH = P @ H.T
        N = turned_covariance(self.rotation, noise)
        gain = np.linalg.solve(H @ PH + N, PH.T).T
        self.retract(-gain @ innovation)
        left = np.eye(len(P)) - gain @ H
        P = left @ P @ left.T + gain @ N @ gain.T  # Joseph's form: it stays positive
        self.covariance = 0.5 * (P + P.T)

    def observation(self) -> Array:
        """Return H: the innovation is ξ_p - ξ_d, shape (3 n, 15 + 3 n)."""
        H = np.zeros((3 * len(self.names), len(self.covariance)))
        for k in range(len(self.names)):
            H[3 * k : 3 * k + 3, POSITION] = np.eye(3)
            H[3 * k : 3 * k + 3, _rows(k)] = -np.eye(3)
        return H

    def retract(self, error: Array) -> None:
        """Replace X̂ by exp(ξ) X̂, and b̂ by b̂ + ζ."""
        turn, left = exp3(error[ROTATION]), jexp3(-error[ROTATION])
        self.rotation = orthonormal(turn @ self.rotation)
        self.velocity = turn @ self.velocity + left @ error[VELOCITY]
        self.position = turn @ self.position + left @ error[POSITION]
        moved = error[FIXED:].reshape(-1, 3)
        self.points = self.points @ turn.T + moved @ left.T
        self.gyroscope_bias = self.gyroscope_bias + error[GYROSCOPE]
        self.accelerometer_bias = self.accelerometer_bias + error[ACCELEROMETER]


def skew(a: Array) -> Array:
    """Return a×, shape (3, 3)."""
    return np.array([[0.0, -a[2], a[1]], [a[2], 0.0, -a[0]], [-a[1], a[0], 0.0]])


def orthonormal(R: Array) -> Array:
    """Return a rotation without its rounding errors: one step of Newton's iteration."""
    return np.asarray(1.5 * R - 0.5 * R @ R.T @ R)


def turned_covariance(R: Array, covariance: Array) -> Array:
    """Return the covariance of points in other axes, shape (3 k, 3 k)."""
    k = len(covariance) // 3
    blocks = covariance.reshape(k, 3, k, 3)
    turned = np.einsum("ij,ajbl,ml->aibm", R, blocks, R)
    return np.asarray(turned.reshape(3 * k, 3 * k))


def _rows(k: int) -> slice:
    """Return the indices of the error of point k."""
    return slice(FIXED + 3 * k, FIXED + 3 * k + 3)
