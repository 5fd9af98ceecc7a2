"""Compare the controller's model of an arm with the robot's own model."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.errors import HardwareError
from hsp_control.robot import Robot

GRAVITY = 2.0
"""Maximum difference of g(q) with which the loop starts [N·m].

The gravity that the arm adds minus the one that the loop subtracts moves the arm. The
bundled Panda and libfranka's Research 3 with the same hand differ by 1.1 N·m at these
postures; if the hand is not set in the robot, by 3.5."""
FREQUENCIES = (0.5, 2.0)
"""Range of the factors by which natural frequencies may change [-].

With Kp = ω² and Kv = 2 ω the errors of a robot with M_r under a controller with M obey
e'' = -λ (2 ω e' + ω² e) along the eigenvectors of M_r⁻¹ M, with its eigenvalues λ > 0:
the natural frequency is √λ ω and the damping ratio √λ. The range keeps the ratio above
a half, and the frequency below twice that for which the gains were chosen. Models of
the wrist differ by as much: the bundled Panda's and Research 3's have √λ = 1.9."""
_POSTURES = 8


@dataclass(frozen=True)
class ModelDifference:
    """How two models of an arm differ.

    Attributes:
        gravity: Largest difference of g(q) [N·m].
        joint: The joint where it is.
        slowest: Smallest factor √λ of a natural frequency [-].
        fastest: Largest factor [-].
    """

    gravity: float
    joint: str
    slowest: float
    fastest: float

    def __str__(self) -> str:
        return (
            f"the controller's model differs from the robot's by {self.gravity:.2g} "
            f"N·m in g(q) ({self.joint}), and M(q) changes natural frequencies by "
            f"factors from {self.slowest:.2g} to {self.fastest:.2g}"
        )

    def check(self, total_mass: float) -> None:
        """Check that the loop may start with these models."""
        least, most = FREQUENCIES
        if self.gravity > GRAVITY or self.slowest < least or self.fastest > most:
            raise HardwareError(
                f"{self}; allowed are {GRAVITY:g} N·m and {least:g} to {most:g}. The "
                f"robot carries {total_mass:.3g} kg beyond its flange (end effector "
                "in Desk, and load). Set the true values, or use the robot's own "
                "model: hsp franka-model ADDRESS my_robot.urdf"
            )


def postures(robot: Robot) -> Array:
    """Return postures at which models are compared, shape (n, 7), always the same."""
    lower, upper = robot.position_limits()
    share = np.random.default_rng(0).uniform(0.1, 0.9, (_POSTURES, robot.nv))
    return np.asarray(lower + share * (upper - lower))


def difference(
    robot: Robot, q: Array, masses: Array, gravities: Array
) -> ModelDifference:
    """Compare the controller's model with M and g of the robot."""
    rest = np.zeros(robot.nv)
    own = np.array([robot.inverse_dynamics(each, rest, rest) for each in q])
    worst = np.abs(own - gravities)
    joint = robot.dof_names[int(np.argmax(worst.max(axis=0)))]
    factors = [
        np.sqrt(np.linalg.eigvals(np.linalg.solve(mass, _mass(robot, each))).real)
        for each, mass in zip(q, masses, strict=True)
    ]
    slowest, fastest = float(np.min(factors)), float(np.max(factors))
    return ModelDifference(float(worst.max()), joint, slowest, fastest)


def _mass(robot: Robot, q: Array) -> Array:
    state = robot.state(0.0, q, np.zeros(robot.nv))
    return np.array(state.mass_matrix)
