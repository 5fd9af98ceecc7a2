"""Kernels: the map of contact forces, their minimum-norm solution, and their cones."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import (
    cholesky,
    multiply,
    multiply_transposed,
    orthogonalise_rows,
    solve_lower,
    solve_lower_transposed,
)
from hsp_control.robot.kinematics import FrameMotion

_NEGLIGIBLE = 1e-10
"""Eigenvalue, relative to the largest, below which a direction has no support."""
_TRUSTED = 1e-6
"""Pivot, relative to the largest, above which no direction is without support."""


@kernel
def force_map(
    frame: FrameMotion,
    points: Array,
    shift: Array,
    axes: Array,
    first: int,
    positions: Array,
    out: Array,
) -> None:
    """Write the positions of the points, and the generalised forces of unit forces.

    A force s at an arm r has the wrench (s, r × s): column Jᵀ(s, r × s).

    ``first`` is the index of the first of these points among all.
    Shapes: points (k, 3), shift (3,), axes (3, 3), positions (all, 3), out (nv, 3 all).
    """
    J, _, R, origin, _ = frame
    for k in range(points.shape[0]):
        p, px, py, pz = first + k, points[k, 0], points[k, 1], points[k, 2]
        x = R[0, 0] * px + R[0, 1] * py + R[0, 2] * pz + shift[0]
        y = R[1, 0] * px + R[1, 1] * py + R[1, 2] * pz + shift[1]
        z = R[2, 0] * px + R[2, 1] * py + R[2, 2] * pz + shift[2]
        positions[p, 0] = origin[0] + x
        positions[p, 1] = origin[1] + y
        positions[p, 2] = origin[2] + z
        for axis in range(3):
            a, b, c = axes[0, axis], axes[1, axis], axes[2, axis]
            d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
            for j in range(J.shape[1]):
                out[j, 3 * p + axis] = (
                    (a * J[0, j] + b * J[1, j] + c * J[2, j])
                    + (d * J[3, j] + e * J[4, j] + f * J[5, j])
                )  # fmt: skip


@kernel
def minimum_norm_forces(
    F: Array,
    base: Indices,
    inverse_cost: Array,
    reference: Array,
    wanted: Array,
    A: Array,
    G: Array,
    U: Array,
    scratch: Array,
    forces: Array,
    tau: Array,
) -> None:
    """Write the forces of minimum Σ (f - r)²/e, and the remaining effort.

    f = r + E Aᵀ(A E Aᵀ)⁺(w - A r) with A the base's rows of F, E = diag(e), w the
    base's rows of the wanted effort, and r what is commanded. w lies in the range of A:
    directions without support are left out. The effort of the base, which has no
    motor, is zero.

    Shapes: F (nv, size), inverse_cost, reference (r) and forces (f) (size,), wanted and
    tau (nv,), A (nb, size), G and U (nb, nb), scratch (2, nb), nb = len(base).
    """
    n, size = base.shape[0], inverse_cost.shape[0]
    w, scaled = scratch[0], scratch[1]
    for i in range(n):
        w[i] = wanted[base[i]]
        for k in range(size):
            A[i, k] = F[base[i], k]
            w[i] -= A[i, k] * reference[k]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(size):
                total += A[i, k] * inverse_cost[k] * A[j, k]
            G[i, j] = G[j, i] = total
    if _well_conditioned(G, U):
        for i in range(n):
            scaled[i] = w[i]
        solve_lower(U, scaled)
        solve_lower_transposed(U, scaled)
    else:
        _least_squares(G, U, w, scaled)
    multiply_transposed(A, scaled, forces)
    for k in range(size):
        forces[k] = reference[k] + inverse_cost[k] * forces[k]
    multiply(F, forces, tau)
    for i in range(tau.shape[0]):
        tau[i] = wanted[i] - tau[i]
    for i in range(n):
        tau[base[i]] = 0.0


@kernel
def _well_conditioned(G: Array, L: Array) -> bool:
    """Write the Cholesky factor of G, and return whether it can be trusted."""
    if not cholesky(G, L):
        return False
    least, most = np.inf, 0.0
    for i in range(G.shape[0]):
        least, most = min(least, L[i, i]), max(most, L[i, i])
    return bool(least * least > _TRUSTED * most * most)


@kernel
def _least_squares(G: Array, U: Array, w: Array, out: Array) -> None:
    """Write G⁺ w, and overwrite G, U and w; G is positive semidefinite, shape (n, n).

    The lengths of the orthogonalised rows of G are its eigenvalues.
    """
    n = G.shape[0]
    orthogonalise_rows(G, U)
    largest = 0.0
    for r in range(n):
        square = 0.0
        for i in range(n):
            square += G[r, i] * G[r, i]
        G[r, 0] = np.sqrt(square)
        largest = max(largest, G[r, 0])
    multiply(U, w, out)
    for r in range(n):
        w[r] = out[r] / G[r, 0] if G[r, 0] > _NEGLIGIBLE * largest else 0.0
    multiply_transposed(U, w, out)


@kernel
def within_cones(cone: Array, forces: Array, lower: Array, upper: Array) -> bool:
    """Return whether forces are within friction cones, cone f ≥ 0, and bounds.

    Shapes: cone (4 size/3, size), forces, lower and upper (size,).
    """
    inside = True
    for k in range(forces.shape[0]):
        inside = inside and lower[k] <= forces[k] <= upper[k]
    for r in range(cone.shape[0]):
        total = 0.0
        point = r // 4
        for k in range(3 * point, 3 * point + 3):
            total += cone[r, k] * forces[k]
        inside = inside and total >= 0.0
    return inside
