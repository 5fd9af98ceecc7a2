"""A robot's mass matrix, its centre of mass and momentum, and their exact rates."""

from copy import copy
from functools import cached_property

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices, read_only_view
from hsp_control.engine import Dynamics
from hsp_control.engine.plans import Once, PartCall, PartCalls
from hsp_control.robot.kinematics import PointMotion, Term


def inertia_terms(
    dynamics: Dynamics, q: Array, v: Array, stamp: Indices
) -> tuple[Term, Term]:
    """Return M (CRBA) and M' along v, shapes (nv, nv)."""
    M, M_dot = np.zeros((v.size, v.size)), np.zeros((v.size, v.size))
    mass_matrix = PartCall(engine.MassMatrix, dynamics=dynamics, q=q, M=M)
    rate = PartCall(engine.MassMatrixRate, dynamics=dynamics, q=q, v=v, M_dot=M_dot)
    return Term(M, [Once.at(stamp, mass_matrix)]), Term(M_dot, [Once.at(stamp, rate)])


class CentroidalMotion:
    """Centre of mass and centroidal angular momentum of a robot, in world axes.

    Attributes:
        calls: Bring the attributes below up to date, if they are not.
        position: The centre of mass c [m], shape (3,).
        velocity: c' [m/s], shape (3,): J v, and the part of masses that change.
        jacobian: J, shape (3, nv).
        jacobian_dot: J' = dJ/dt along v, exact, shape (3, nv).
        own_acceleration: Their part of c'' beside J a + J' v [m/s²], shape (3,).
        own_momentum: Their part of the rate of A v/m [m²/s²], shape (3,).
        momentum_matrix: A, where A v is the angular momentum about c [kg·m²/s], shape
            (3, nv).
        momentum_matrix_dot: A' = dA/dt along v, exact, shape (3, nv).
    """

    def __init__(
        self,
        model: pin.Model,
        dynamics: Dynamics,
        q: Array,
        v: Array,
        stamp: Indices,
    ) -> None:
        """Allocate the arrays; `calls` take the values that q and v have then."""
        self._mass: Array = np.zeros(1)
        self.position: Array = np.zeros(3)
        self.velocity: Array = np.zeros(3)
        self.own_acceleration: Array = np.zeros(3)
        self.own_momentum: Array = np.zeros(3)
        self.jacobian: Array = np.zeros((3, model.nv))
        self.jacobian_dot: Array = np.zeros((3, model.nv))
        self.momentum_matrix: Array = np.zeros((3, model.nv))
        self.momentum_matrix_dot: Array = np.zeros((3, model.nv))
        call = PartCall(
            engine.CentroidalMotion,
            dynamics=dynamics,
            q=q,
            v=v,
            mass=self._mass,
            position=self.position,
            velocity=self.velocity,
            own_acceleration=self.own_acceleration,
            own_momentum=self.own_momentum,
            J=self.jacobian,
            J_dot=self.jacobian_dot,
            angular=self.momentum_matrix,
            angular_dot=self.momentum_matrix_dot,
        )
        self.calls: PartCalls = [Once.at(stamp, call)]

    @property
    def mass(self) -> float:
        """Total mass, payloads included [kg]."""
        return float(self._mass[0])

    @cached_property
    def shown(self) -> "CentroidalMotion":
        """The same, with arrays that can be read, but not written."""
        shown = copy(self)
        for name, value in vars(self).items():
            if isinstance(value, np.ndarray):
                setattr(shown, name, read_only_view(value))
        return shown

    def supplied(self) -> tuple[PointMotion, PartCalls]:
        """Return the centre's motion as an argument of a call; see `planned`."""
        motion = PointMotion(
            self.jacobian,
            self.jacobian_dot,
            self.position,
            self.velocity,
            self.own_acceleration,
        )
        return motion, self.calls
