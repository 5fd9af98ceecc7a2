"""The QP of a limited step, assembled with NumPy and solved by DAQP: an oracle.

It shares only a constant with the kernels: the cost is a dense matrix, the contacts are
rows.
"""

from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from hsp_control.common.arrays import Array
from hsp_control.control.actuation.support import Support
from hsp_control.edge import BoundLaw

_EQUALITY, _INEQUALITY = 5, 0


class Rows(NamedTuple):
    """Rows lower ≤ A x ≤ upper: A (k, n), lower and upper (k,)."""

    A: Array
    lower: Array
    upper: Array


def solve(H: Array, f: Array, rows: Rows) -> Array | None:
    """Minimise ½ xᵀH x + fᵀx within rows; None if the solver finds no solution."""
    lower, upper = rows.lower, rows.upper
    sense = np.where(upper - lower < 1e-12, _EQUALITY, _INEQUALITY).astype(np.int32)
    arrays = [np.ascontiguousarray(each) for each in (H, f, rows.A)]
    x, _, flag, _ = daqp.solve(*arrays, upper, lower, sense, primal_tol=1e-9)
    if flag < 1 or not np.isfinite(x).all():
        return None
    return np.asarray(x)


def stacked(*rows: Rows) -> Rows:
    """Return all rows in one `Rows`."""
    return Rows(*(np.concatenate(parts) for parts in zip(*rows, strict=True)))


def level_costs(
    law: BoundLaw, supported: bool, size: float, held: Array, slack: float
) -> Array:
    """Return ρ of each level, then of the null space, shape (levels + 1,).

    The cost of levels below one is the slack times that level's error over the robot's
    size, that at most a tenth, and at least ``costs``; or ``held``, if larger, up to
    the cost of the level itself. Below contacts it is ``costs`` for any error. Contacts
    cost as much as the level below them; so do springs without contacts.
    """
    count = len(law.ends) - supported
    least = 1e-6 ** (1.0 / max(count, 1))
    costs, start = [1.0], 0
    for k, end in enumerate(law.ends):
        error = np.linalg.norm(law.problem.task.error[start:end])
        of_error = 0.2 if k == len(law.ends) - 1 else 1.0
        below = max(slack * min(of_error * error / size, 0.1), held[k])
        below = np.clip(0.0 if supported else below, least, 1.0)
        springs = law.problem.springs[start:end].all() and not supported
        equal = springs or (supported and k == 0)
        costs.append(costs[-1] * (1.0 if equal else below))
        start = end
    return np.array(costs)


def deviation_cost(
    law: BoundLaw, supported: bool, size: float, held: Array, slack: float
) -> Array:
    """Return H, shape (nv, nv), also where levels share directions.

    log H = Σ log ρ_k (P_{k-1} - P_k), with P_k from the spectra of the levels: by the
    damped law in proportion to the slack, the rest by the exact one.
    """
    L = law.problem.metric.L
    logs = np.log(level_costs(law, supported, size, held, slack))
    log_H = np.zeros_like(L)
    for share, thresholds in (
        (slack, law.thresholds),
        (1.0 - slack, 0.0 * law.thresholds),
    ):
        if share > 0.0:
            log_H += share * _log_cost(law, logs, thresholds)
    steps, V = np.linalg.eigh(log_H)
    return np.asarray(L @ (V * np.exp(steps)) @ V.T @ L.T)


def _log_cost(law: BoundLaw, logs: Array, thresholds: Array) -> Array:
    """Return log H in whitened coordinates, of a law with given thresholds."""
    J, L = law.problem.task.jacobian, law.problem.metric.L
    whitened, n = np.linalg.solve(L, J.T).T / law.units[:, None], len(L)
    P, T, start = np.eye(n), np.zeros((n, n)), 0
    for k, end in enumerate(law.ends):
        B, floor = whitened[start:end], max(thresholds[k], 1e-9) ** 2
        sizes, U = np.linalg.eigh(B @ P @ B.T)
        above = np.maximum(sizes, floor)
        inverse = np.where(sizes < floor, (2.0 - sizes / floor) / floor, 1.0 / above)
        own = P @ B.T @ (U * inverse) @ U.T @ B @ P
        T += logs[k] * own
        P = P - own
        start = end
    return np.asarray(T + logs[-1] * P)


class Step(NamedTuple):
    """A limited step: H, f and rows in the unknowns (δ, forces in robot weights)."""

    H: Array
    f: Array
    rows: Rows


def limited_step(
    M: Array,
    a: Array,
    wanted: Array,
    tau: tuple[Array, Array],
    motion: tuple[Array, Array],
    law: BoundLaw,
    support: Support,
    base: NDArray[np.int64],
    weight: float,
    size: float,
    costs: Array,
    slack: float,
) -> Step:
    """Return the QP of efforts within bounds, motion within bounds, and cones.

    Args:
        M: Mass matrix.
        a: The law's acceleration.
        wanted: The unconstrained effort M a + N.
        tau: Bounds on the effort.
        motion: Bounds on the acceleration.
        law: The resolved law.
        support: The active contacts, with forces of minimum norm.
        base: Degrees of freedom without a motor.
        weight: The robot's weight [N].
        size: The robot's size [m].
        costs: Smallest costs below each level, shape (levels,).
        slack: Of the priorities.
    """
    n, p = len(a), support.size
    H = np.zeros((n + p, n + p))
    H[:n, :n] = deviation_cost(law, p > 0, size, costs, slack)
    cost = (1e-6 if len(base) else 1e-14) / np.maximum(support.inverse_cost, 1e-6)
    H[range(n, n + p), range(n, n + p)] = cost
    f = np.zeros(n + p)
    f[n:] = -cost * support.forces / weight
    effort = np.hstack([M, -support.map * weight])
    motors = np.setdiff1d(np.arange(n), base)
    mass = weight / 9.81
    held = sum(contact.rows for contact in support.contacts)
    J = np.zeros((held, n + p))
    J[:, :n] = law.problem.task.jacobian[:held]
    cone = np.zeros((len(support.cone), n + p))
    cone[:, n:] = support.cone
    rows = [
        Rows(effort[base] / mass, -wanted[base] / mass, -wanted[base] / mass),
        Rows(
            effort[motors],
            tau[0][motors] - wanted[motors],
            tau[1][motors] - wanted[motors],
        ),
        Rows(J, np.zeros(held), np.zeros(held)),
        Rows(cone, np.zeros(len(cone)), np.full(len(cone), np.inf)),
        Rows(
            np.eye(n + p),
            np.concatenate([motion[0] - a, support.lower / weight]),
            np.concatenate([motion[1] - a, support.upper / weight]),
        ),
    ]
    return Step(H, f, stacked(*rows))
