"""The QP of a limited step, assembled with NumPy and solved by DAQP: an oracle.

It shares no code with the kernels: the cost is a dense matrix, the contacts are rows.
"""

from typing import NamedTuple

import daqp
import numpy as np
from numpy.typing import NDArray

from hsp_control.control.actuation.support import Support
from hsp_control.law import Resolution

Array = NDArray[np.float64]

_EQUALITY, _INEQUALITY = 5, 0
_FORCE_COST = 1e-6


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


def level_directions(resolution: Resolution) -> list[Array]:
    """Return orthonormal rows for each level in whitened coordinates, by SVD."""
    J, L = resolution.problem.task.jacobian, resolution.problem.metric.L
    whitened = np.linalg.solve(L, J.T).T
    found = np.zeros((0, J.shape[1]))
    levels, start = [], 0
    for end in resolution.ends:
        rest = whitened[start:end] - whitened[start:end] @ found.T @ found
        _, sizes, V = np.linalg.svd(rest, full_matrices=False)
        own = V[sizes > resolution.threshold]
        levels.append(own)
        found = np.vstack([found, own])
        start = end
    return levels


def deviation_cost(
    resolution: Resolution, supported: bool, weight: float | None = None
) -> Array:
    """Return H = L (Σ ρ_k N_kᵀN_k + ρ_N P) Lᵀ, shape (nv, nv)."""
    L = resolution.problem.metric.L
    found = level_directions(resolution)
    levels = len(found) - supported
    whole = weight or (1e-6 if levels <= 1 else 1e-8)
    H = whole * np.eye(len(L))
    for k, N in enumerate(found):
        cost = whole ** (max(k - supported, 0) / max(levels, 1))
        H += (cost - whole) * N.T @ N
    return np.asarray(L @ H @ L.T)


def shared_cost(resolution: Resolution, weight: float = 1e-8) -> tuple[Array, Array]:
    """Return H and P where levels share directions, shape (nv, nv) each.

    log H = log weight Σ t_k (P_{k-1} - P_k), with P_k from the spectra of the levels.
    """
    J, L = resolution.problem.task.jacobian, resolution.problem.metric.L
    whitened = np.linalg.solve(L, J.T).T
    floor, n, levels = resolution.threshold**2, len(L), len(resolution.ends)
    P, T, start = np.eye(n), np.zeros((n, n)), 0
    for k, end in enumerate(resolution.ends):
        B = whitened[start:end]
        sizes, U = np.linalg.eigh(B @ P @ B.T)
        above = np.maximum(sizes, floor)
        inverse = np.where(sizes < floor, (2.0 - sizes / floor) / floor, 1.0 / above)
        own = P @ B.T @ (U * inverse) @ U.T @ B @ P
        T += k / levels * own
        P = P - own
        start = end
    steps, V = np.linalg.eigh(T + P)
    H = (V * weight**steps) @ V.T
    return L @ H @ L.T, np.linalg.solve(L.T, P @ L.T)


def second_weight(
    resolution: Resolution, supported: bool, H: Array, deviation: Array
) -> float:
    """Return the cost of the null space after a first optimum.

    It is the first one's, or where the tasks miss by more a twentieth of what that
    costs, divided by the square of the null space's motion.
    """
    n = len(resolution.problem.metric.L)
    L, delta = resolution.problem.metric.L, deviation[:n]
    N = np.vstack(level_directions(resolution))
    left = L.T @ delta - N.T @ (N @ L.T @ delta)
    moved = float(left @ left)
    first = 1e-6 if len(resolution.ends) - supported <= 1 else 1e-8
    missed = float(delta @ H[:n, :n] @ delta) - first * moved
    return max(first, min(0.05 * missed / moved, 1.0)) if moved > 0.0 else first


def with_null_space_cost(
    H: Array, resolution: Resolution, old: float, new: float
) -> Array:
    """Return a cost of deviations with another cost of the null space."""
    L = resolution.problem.metric.L
    n = len(L)
    N = np.vstack(level_directions(resolution))
    changed = H.copy()
    changed[:n, :n] += (new - old) * L @ (np.eye(n) - N.T @ N) @ L.T
    return changed


def null_space_projector(resolution: Resolution) -> Array:
    """Return P = 1 - L⁻ᵀ Nᵀ N Lᵀ, shape (nv, nv)."""
    L = resolution.problem.metric.L
    N = np.vstack(level_directions(resolution))
    return np.asarray(np.eye(len(L)) - np.linalg.solve(L.T, N.T @ N @ L.T))


class Step(NamedTuple):
    """A limited step: H, f and rows of the unknowns (δ, forces in robot weights)."""

    H: Array
    f: Array
    rows: Rows


def limited_step(
    M: Array,
    a: Array,
    wanted: Array,
    tau: tuple[Array, Array],
    motion: tuple[Array, Array],
    resolution: Resolution,
    support: Support,
    base: NDArray[np.int64],
    weight: float,
    null_space_weight: float | None = None,
) -> Step:
    """Return the QP of efforts within bounds, motion within bounds, and cones.

    Args:
        M: Mass matrix.
        a: The law's acceleration.
        wanted: M a + N.
        tau: Bounds on the effort.
        motion: Bounds on the acceleration.
        resolution: The resolved law.
        support: The active contacts, with forces of minimum norm.
        base: Degrees of freedom without a motor.
        weight: The robot's weight [N].
        null_space_weight: Cost of null-space deviation.
    """
    n, p = len(a), support.size
    H = np.zeros((n + p, n + p))
    H[:n, :n] = deviation_cost(resolution, p > 0, null_space_weight)
    cost = _FORCE_COST / np.maximum(support.inverse_cost, 1e-6)
    H[range(n, n + p), range(n, n + p)] = cost
    f = np.zeros(n + p)
    f[n:] = -cost * support.forces / weight
    effort = np.hstack([M, -support.map * weight])
    motors = np.setdiff1d(np.arange(n), base)
    mass = weight / 9.81
    held = sum(contact.rows for contact in support.contacts)
    J = np.zeros((held, n + p))
    J[:, :n] = resolution.problem.task.jacobian[:held]
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
