"""How fast the null space is to be: K_N and the slope of the field, at a state."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.controller import Controller
from hsp_control.law import FieldSample, MetricSample
from hsp_control.robot import RobotState

_STEP = 1e-5
"""Step of the differences [rad or m]."""


def null_space_rates(controller: Controller, state: RobotState) -> tuple[Array, Array]:
    """Return K_N and the field's slope A ≥ 0 in the null space, shape (k, k) each.

    Both are in coordinates that are orthonormal in the metric. A is the symmetric part
    of -∂g/∂q, by central differences, `without_saddles`.
    """
    nothing = np.zeros((0, 0))
    if not controller.field.controls:
        return nothing, nothing
    J = controller.stack(state).jacobian
    L = controller.active_stack.resolution.problem.metric.L
    across = np.linalg.solve(L, J.T).T  # J L⁻ᵀ
    _, values, Vt = np.linalg.svd(across)
    rank = int((values > controller.active_stack.resolution.threshold).sum())
    Z = Vt[rank:].T
    if not Z.size:
        return nothing, nothing
    into, out_of = L.T, np.linalg.inv(L.T)
    A = -Z.T @ into @ field_slope(controller, state) @ out_of @ Z
    K = Z.T @ into @ controller.null_space_gain @ out_of @ Z
    return K, without_saddles(A)


def without_saddles(A: Array) -> Array:
    """Return the symmetric part of a slope, with 0 for its negative eigenvalues.

    There the field drives the robot away from a point (a saddle of its cost), which is
    intended, and no control rate changes it.
    """
    values, U = np.linalg.eigh(0.5 * (A + A.T))
    stable: Array = (U * np.maximum(values, 0.0)) @ U.T
    return stable


def field_slope(controller: Controller, state: RobotState) -> Array:
    """Return ∂g/∂q at a state, shape (nv, nv), by central differences."""
    nv, metric = state.robot.nv, MetricSample.allocate(state.robot.nv)
    out, slope = FieldSample.allocate(nv), np.zeros((nv, nv))
    for i in range(nv):
        for sign in (1.0, -1.0):
            moved = np.zeros(nv)
            moved[i] = sign * _STEP
            near = state.displaced(0.0, moved)
            controller.metric.evaluate(near, metric)
            controller.field.evaluate(near, metric, controller.metric.form, out)
            slope[:, i] += sign * out.g / (2.0 * _STEP)
    return slope
