"""The centre of mass and the angular momentum about it, with exact Jacobians."""

from collections.abc import Callable

import numpy as np
import pinocchio as pin

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.native import bind, once
from hsp_control.robot.matrix_view import matrix_view
from hsp_control.robot.pinocchio_calls import bind_pinocchio


class CentroidalMotion:
    """Centre of mass and centroidal angular momentum of a robot, in world axes."""

    def __init__(
        self, model: pin.Model, data: pin.Data, q: Array, v: Array, stamp: Indices
    ) -> None:
        """Allocate the arrays; `compute` takes the values that q and v have then."""
        # Pinocchio allocates these results at the first call; take views after it.
        pin.computeCentroidalMapTimeVariation(model, data, q, v)
        self.mass: float = pin.computeTotalMass(model)  # total mass [kg]
        self.position: Array = data.com[0]  # the centre of mass c [m], shape (3,)
        self.velocity: Array = np.zeros(3)  # c' = J v [m/s], shape (3,)
        self.jacobian: Array = np.zeros((3, model.nv))  # J, shape (3, nv)
        # J' = dJ/dt along v, exact, shape (3, nv)
        self.jacobian_dot: Array = np.zeros((3, model.nv))
        # A, where A v is the angular momentum about c [kg·m²/s], shape (3, nv)
        self.momentum_matrix: Array = np.zeros((3, model.nv))
        # A' = dA/dt along v, exact, shape (3, nv)
        self.momentum_matrix_dot: Array = np.zeros((3, model.nv))
        momentum = bind_pinocchio("centroidal", model, data, q, v)
        extract = bind(
            _extract,
            matrix_view(data.Ag),
            matrix_view(data.dAg),
            self.mass,
            v,
            self.velocity,
            self.jacobian,
            self.jacobian_dot,
            self.momentum_matrix,
            self.momentum_matrix_dot,
        )
        # updates the attributes below to the state, if they are not up to date
        self.compute: Callable[[], object] = once([momentum, extract], stamp)


@kernel
def _extract(
    A: Array,
    A_dot: Array,
    mass: float,
    v: Array,
    velocity: Array,
    J: Array,
    J_dot: Array,
    angular: Array,
    angular_dot: Array,
) -> None:
    """Write the linear rows divided by the mass, and the angular rows with their rate.

    Pinocchio's A' is the rate about a point at rest, but the centre of mass moves. The
    rate of the angular rows about c is A' - m c' × J (checked against finite
    differences; Pinocchio's product A'v is right as it is, since c' × c' = 0).
    """
    for i in range(3):
        velocity[i] = 0.0
    for j in range(v.shape[0]):
        for i in range(3):
            J[i, j] = A[i, j] / mass
            J_dot[i, j] = A_dot[i, j] / mass
            angular[i, j] = A[3 + i, j]
            velocity[i] += J[i, j] * v[j]
    x, y, z = velocity[0], velocity[1], velocity[2]
    for j in range(v.shape[0]):
        px, py, pz = A[0, j], A[1, j], A[2, j]
        angular_dot[0, j] = A_dot[3, j] - (y * pz - z * py)
        angular_dot[1, j] = A_dot[4, j] - (z * px - x * pz)
        angular_dot[2, j] = A_dot[5, j] - (x * py - y * px)
