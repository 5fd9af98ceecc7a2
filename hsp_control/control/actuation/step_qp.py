"""The QP of a step within limits: kernels that assemble it and solve it.

The unknowns are x = (δ, g): δ the deviation from the law's acceleration, and g the
contact forces in robot weights. The rows, in this order:

    base        (M a + N - F f)_base = 0                          no motor acts there
    effort      bounds on M a + N - F f, within the rate limit of the last effort
    cones       friction cones of f
    barriers    ∇d·a and ∇G·a from `MinimumDistance` and `StaticEffort`
    contacts    J_c δ = 0, only where limits contradict each other: else it holds
                because no direction of the contacts is among those that may move

and the bounds of x: those on a from position, velocity and acceleration limits, and
those of f.
"""

from typing import NamedTuple

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.constraints.limits.acceleration_bounds import Bounds
from hsp_control.control.actuation.deviation_cost import (
    Directions,
    write_directions,
    write_inverse_root,
)
from hsp_control.control.actuation.dual_active_set import (
    SOLVED,
    Problem,
    Workspace,
    minimise,
)
from hsp_control.control.actuation.status import Status

_FORCE_COST = 1e-6
"""Cost of squared forces, in robot weights, relative to accelerations. It makes the
forces unique, and is small beside the cost of any deviation."""
_LEAST_INVERSE_COST = 1e-6
"""While a contact fades its forces become dear, but not infinitely so."""
UNSOLVED = 0
"""No `Status` of a QP: the constraints contradict each other, or the solver gave up."""
FORCES, NEAREST, NEAREST_AGAIN, LEAST_VIOLATION = 0, 1, 2, 3
"""What to find: forces for the law's acceleration, and if there are none the nearest
acceleration; this acceleration at once; it again, with the rows as they are, those of
the contacts too; or the least violation of the soft rows."""


class Wanted(NamedTuple):
    """What the law wants."""

    mass_matrix: Array  # M, shape (nv, nv)
    acceleration: Array  # a, shape (nv,)
    # M a + N and friction, without contact forces, shape (nv,) [N·m or N]
    effort: Array


class Forces(NamedTuple):
    """The contact forces f that are possible, see `Support`; size 0: none."""

    map: Array  # F, shape (nv, p)
    first: Array  # forces nearest to the commanded ones, shape (p,) [N]
    lower: Array  # lower bounds, shape (p,) [N]
    upper: Array  # upper bounds, shape (p,) [N]
    inverse_cost: Array  # e, shape (p,): the cost is Σ (f - f_ref)²/e
    weight: float  # robot's weight [N]


class Places(NamedTuple):
    """Where the rows are."""

    # degrees of freedom of the first rows: those without a motor, then those with a
    # limit on their effort
    dofs: Indices
    base: int  # how many have no motor


class Programmes(NamedTuple):
    """The QPs of a step, on the same rows and unknowns, and their memories."""

    forces: Problem  # of the forces alone
    nearest: Problem  # of deviation and forces, at the law's cost
    soft: Problem  # of deviation and forces, all at the same cost, with soft rows
    x: Array  # unknowns, shape (nv + p,)
    force_memory: Workspace  # of the first
    memory: Workspace  # of the second
    soft_memory: Workspace  # of the third


class Result(NamedTuple):
    """What is delivered: effort and acceleration, shape (nv,), forces, shape (p,)."""

    effort: Array
    acceleration: Array
    forces: Array


@kernel
def solve_step(
    what: int,
    wanted: Wanted,
    forces: Forces,
    directions: Directions,
    bounds: Bounds,
    places: Places,
    programmes: Programmes,
    result: Result,
) -> int:
    """Assemble the QP, solve it, and write what is delivered; return a `Status`.

    Or `UNSOLVED`, and then nothing is written to ``result``.
    """
    qp, x = programmes, programmes.x
    if what == LEAST_VIOLATION:
        code = minimise(qp.soft, False, x, qp.soft_memory)
        if code == SOLVED and _write_result(wanted, forces, bounds, places, x, result):
            return Status.RELAXED
        return UNSOLVED
    if what != NEAREST_AGAIN:
        _write_rows(wanted, forces, bounds, places, qp.nearest)
        if what == FORCES:
            _start(forces, x)
            _write_force_factor(forces, 1.0, qp.forces)
            code = minimise(qp.forces, True, x, qp.force_memory)
            if code == SOLVED and _write_result(
                wanted, forces, bounds, places, x, result
            ):
                return Status.REDISTRIBUTED
        write_directions(directions)
    _start(forces, x)
    contacts_held = what != NEAREST_AGAIN and forces.first.shape[0] > 0
    count = write_inverse_root(directions, 1 if contacts_held else 0, qp.nearest.JT)
    _write_force_factor(forces, _FORCE_COST, qp.nearest)
    problem, warm = _moving(qp.nearest, count), what != NEAREST_AGAIN
    if minimise(problem, warm, x, qp.memory) != SOLVED:
        return UNSOLVED
    if _write_result(wanted, forces, bounds, places, x, result):
        return Status.LIMITED
    return UNSOLVED


@kernel
def _start(forces: Forces, x: Array) -> None:
    """Write the unconstrained optimum: no deviation, and forces of minimum norm."""
    n = x.shape[0] - forces.first.shape[0]
    for i in range(n):
        x[i] = 0.0
    for j in range(forces.first.shape[0]):
        x[n + j] = forces.first[j] / forces.weight


@kernel
def _write_force_factor(forces: Forces, cost: float, problem: Problem) -> None:
    """Write the forces' part of J."""
    for j in range(problem.own.shape[0]):
        inverse_cost = max(forces.inverse_cost[j], _LEAST_INVERSE_COST)
        problem.own[j] = np.sqrt(inverse_cost / cost)


@kernel
def _moving(problem: Problem, count: int) -> Problem:
    """Return a QP in which only the first rows of Jᵀ move."""
    JT, own, A, begin, end, lower, upper, softness, equalities = problem
    return Problem(JT[:count], own, A, begin, end, lower, upper, softness, equalities)


@kernel
def _write_rows(
    wanted: Wanted, forces: Forces, bounds: Bounds, places: Places, rows: Problem
) -> None:
    """Write the rows of base and efforts, and the bounds of x."""
    M, a, effort = wanted
    F, _, f_lower, f_upper, _, weight = forces
    A, lower, upper = rows.A, rows.lower, rows.upper
    n, p = F.shape
    for r in range(places.dofs.shape[0]):
        i = places.dofs[r]
        for j in range(n):
            A[r, j] = M[i, j]
        for j in range(p):
            A[r, n + j] = -F[i, j] * weight
        no_motor = r < places.base
        lower[r] = (0.0 if no_motor else bounds.tau_lower[i]) - effort[i]
        upper[r] = (0.0 if no_motor else bounds.tau_upper[i]) - effort[i]
    k = A.shape[0]
    for i in range(n):
        lower[k + i] = bounds.a_lower[i] - a[i]
        upper[k + i] = bounds.a_upper[i] - a[i]
    for j in range(p):
        lower[k + n + j], upper[k + n + j] = f_lower[j] / weight, f_upper[j] / weight


@kernel
def _write_result(
    wanted: Wanted,
    forces: Forces,
    bounds: Bounds,
    places: Places,
    x: Array,
    result: Result,
) -> bool:
    """Write the result without the solver's violations; return whether it is finite."""
    M, a, effort = wanted
    F, _, f_lower, f_upper, _, weight = forces
    n, p = F.shape
    for j in range(p):
        result.forces[j] = min(max(x[n + j] * weight, f_lower[j]), f_upper[j])
    sum_of_efforts = 0.0
    for i in range(n):
        total = effort[i]
        for j in range(n):
            total += M[i, j] * x[j]
        for j in range(p):
            total -= F[i, j] * result.forces[j]
        result.effort[i] = min(max(total, bounds.tau_lower[i]), bounds.tau_upper[i])
        result.acceleration[i] = a[i] + x[i]
        sum_of_efforts += total
    for r in range(places.base):
        result.effort[places.dofs[r]] = 0.0
    return bool(np.isfinite(sum_of_efforts))
