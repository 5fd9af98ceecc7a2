"""A robot's mass matrix, its centre of mass and momentum, and their exact rates."""

from collections.abc import Sequence
from copy import copy
from functools import cached_property

import numpy as np
import pinocchio as pin

from hsp_control import engine
from hsp_control.common.arrays import (
    Array,
    Indices,
    kept_view,
    matrix_view,
    read_only_view,
)
from hsp_control.common.exceptions import ModelError
from hsp_control.common.suggestions import listing
from hsp_control.engine.plans import Once, PartCall, PartCalls
from hsp_control.robot.kinematics import PointMotion, Term


def inertia_terms(
    model: pin.Model, data: pin.Data, q: Array, v: Array, stamp: Indices
) -> tuple[Term, Term]:
    """Return M (CRBA) and M' = C + Cᵀ along v, shape (nv, nv) each."""
    value = kept_view(matrix_view(data.M), data)
    M = Term(value, [Once.at(stamp, *_mass_matrix_calls(model, data, q))])
    M_dot = np.zeros((model.nv, model.nv))
    if model.mimicking_joints:  # Pinocchio has no C of such a model
        own = model.createData()
        difference = PartCall(
            _write_difference, model=model, data=own, q=q, v=v, M_dot=M_dot
        )
        return M, Term(M_dot, [Once.at(stamp, difference)])
    coriolis = PartCall(pin.computeCoriolisMatrix, model=model, data=data, q=q, v=v)
    add = PartCall(engine.InertiaRate, C=matrix_view(data.C), M_dot=M_dot)
    return M, Term(M_dot, [Once.at(stamp, coriolis, add)])


def mass_matrix(model: pin.Model, data: pin.Data, q: Array) -> Array:
    """Return M(q), shape (nv, nv), whatever the data were used for before.

    Of models with mimic joints Pinocchio's CRBA (seen with 4.1) adds to `data.Fcrb` and
    `data.M`, which it does not clear: a second M would contain a part of the first one.
    So nobody else calls ``pin.crba`` with data that are used again.
    """
    for matrix in _remembered(model, data):
        matrix[:] = 0.0
    return np.asarray(pin.crba(model, data, q))


def _mass_matrix_calls(
    model: pin.Model, data: pin.Data, q: Array
) -> Sequence[PartCall]:
    """Return the calls of `mass_matrix`."""
    clearing: list[PartCall] = [
        PartCall(engine.Clear, matrix=matrix) for matrix in _remembered(model, data)
    ]
    return [*clearing, PartCall(pin.crba, model=model, data=data, q=q)]


def _remembered(model: pin.Model, data: pin.Data) -> list[Array]:
    """Return what CRBA does not clear itself, views of the data."""
    if not model.mimicking_joints:
        return []
    return [kept_view(matrix_view(each), data) for each in (*data.Fcrb, data.M)]


def _write_difference(
    model: pin.Model, data: pin.Data, q: Array, v: Array, M_dot: Array
) -> None:
    """Write M' along v by differences."""
    h = 1e-3 / max(1.0, float(np.abs(v).max()))

    def M(s: float) -> Array:
        return mass_matrix(model, data, pin.integrate(model, q, s * v)).copy()

    M_dot[:] = (8.0 * (M(h) - M(-h)) - (M(2.0 * h) - M(-2.0 * h))) / (12.0 * h)


class CentroidalMotion:
    """Centre of mass and centroidal angular momentum of a robot, in world axes.

    Attributes:
        calls: Bring the attributes below up to date, if they are not.
        mass: Total mass [kg].
        position: The centre of mass c [m], shape (3,).
        velocity: c' = J v [m/s], shape (3,).
        jacobian: J, shape (3, nv).
        jacobian_dot: J' = dJ/dt along v, exact, shape (3, nv).
        momentum_matrix: A, where A v is the angular momentum about c [kg·m²/s], shape
            (3, nv).
        momentum_matrix_dot: A' = dA/dt along v, exact, shape (3, nv).
    """

    def __init__(
        self, model: pin.Model, data: pin.Data, q: Array, v: Array, stamp: Indices
    ) -> None:
        """Allocate the arrays; `calls` take the values that q and v have then."""
        if mimics := [model.names[index] for index in model.mimicking_joints]:
            raise ModelError(
                f"{model.name}: the centre of mass and the momentum do not support "
                f"mimic joints, and {listing(map(repr, mimics))} are some; load the "
                "robot with mimic=False"
            )
        # Pinocchio allocates these results at the first call; take views after it.
        pin.computeCentroidalMapTimeVariation(model, data, q, v)
        self.mass: float = pin.computeTotalMass(model)
        self.position: Array = kept_view(data.com[0], data)
        self.velocity: Array = np.zeros(3)
        self.jacobian: Array = np.zeros((3, model.nv))
        self.jacobian_dot: Array = np.zeros((3, model.nv))
        self.momentum_matrix: Array = np.zeros((3, model.nv))
        self.momentum_matrix_dot: Array = np.zeros((3, model.nv))
        momentum = PartCall(
            pin.computeCentroidalMapTimeVariation, model=model, data=data, q=q, v=v
        )
        extract = PartCall(
            engine.CentroidalRows,
            A=matrix_view(data.Ag),
            A_dot=matrix_view(data.dAg),
            mass=self.mass,
            v=v,
            velocity=self.velocity,
            J=self.jacobian,
            J_dot=self.jacobian_dot,
            angular=self.momentum_matrix,
            angular_dot=self.momentum_matrix_dot,
        )
        # It reads the velocity of the centre, which it does not write: of others' calls
        # nothing is to be in A'.
        rest = PartCall(
            engine.Clear, matrix=kept_view(data.vcom[0].reshape(1, 3), data)
        )
        self.calls: PartCalls = [Once.at(stamp, rest, momentum, extract)]

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
        J, J_dot = self.jacobian, self.jacobian_dot
        return PointMotion(J, J_dot, self.position, self.velocity), self.calls
