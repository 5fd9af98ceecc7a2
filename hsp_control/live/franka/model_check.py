"""Compare the controller's model of an arm with the robot's own model."""

from dataclasses import dataclass

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import HardwareError
from hsp_control.robot import Robot

GRAVITY = 2.0
"""Largest difference of g(q) with which the loop starts [N·m].

What the arm adds for gravity minus what the loop takes off moves the arm: a tenth of the
torque at which it reports a collision. A forgotten hand (0.73 kg) makes 4 N·m, half a
kilogram at half a metre 2.5."""
INERTIA = 0.5
"""Largest alpha = |1 - M_r⁻¹ M| (its largest eigenvalue) with which the loop starts [-].

Below 1, the classical bound of computed torque: the loop's errors stay bounded (Spong,
Hutchinson, Vidyasagar, *Robot Modeling and Control*, robust inverse dynamics). Half of
it remains for the rest of what models do not know."""
_POSTURES = 8


@dataclass(frozen=True)
class ModelDifference:
    """How two models of an arm differ.

    Attributes:
        gravity: Largest difference of g(q) [N·m].
        joint: The joint where it is.
        inertia: alpha = |1 - M_r⁻¹ M|, the largest eigenvalue [-].
    """

    gravity: float
    joint: str
    inertia: float

    def __str__(self) -> str:
        return (
            f"the controller's model differs from the robot's by {self.gravity:.2g} N·m "
            f"in g(q) ({self.joint}) and {100.0 * self.inertia:.2g} % in M(q)"
        )

    def check(self, total_mass: float) -> None:
        """Check that the loop may start with these models.

        Args:
            total_mass: What hangs on the flange as the robot knows it [kg].

        Raises:
            HardwareError: If they differ too much.
        """
        if self.gravity > GRAVITY or self.inertia > INERTIA:
            raise HardwareError(
                f"{self}; {GRAVITY:g} N·m and {100.0 * INERTIA:g} % are allowed. The "
                f"robot carries {total_mass:.3g} kg beyond its flange (end effector "
                "in Desk, and load). Set what is there, or take the robot's own "
                "model: hsp franka-model ADDRESS my_robot.urdf"
            )


def postures(robot: Robot) -> Array:
    """Return postures at which models are compared, shape (n, 7), always the same."""
    lower, upper = robot.position_limits()
    share = np.random.default_rng(0).uniform(0.1, 0.9, (_POSTURES, robot.nv))
    return np.asarray(lower + share * (upper - lower))


def difference(robot: Robot, q: Array, masses: Array, gravities: Array) -> ModelDifference:
    """Compare the controller's model with M and g of the robot.

    Args:
        robot: The controller's model.
        q: Postures, shape (n, 7).
        masses: The robot's M(q), shape (n, 7, 7).
        gravities: The robot's g(q), shape (n, 7).
    """
    rest = np.zeros(robot.nv)
    own = np.array([robot.inverse_dynamics(each, rest, rest) for each in q])
    worst = np.abs(own - gravities)
    joint = robot.dof_names[int(np.argmax(worst.max(axis=0)))]
    alphas = [
        np.abs(np.linalg.eigvals(np.eye(7) - np.linalg.solve(mass, _mass(robot, each))))
        for each, mass in zip(q, masses, strict=True)
    ]
    return ModelDifference(float(worst.max()), joint, float(np.max(alphas)))


def _mass(robot: Robot, q: Array) -> Array:
    state = robot.state(0.0, q, np.zeros(robot.nv))
    return np.array(state.mass_matrix)
