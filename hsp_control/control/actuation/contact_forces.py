"""What contact forces push, and the least of them that hold a base: as kernels."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.common.kernels import kernel
from hsp_control.common.linalg import multiply, multiply_transposed, orthogonalise_rows

_KEPT = 1e-10
"""Part of the greatest eigenvalue below which a direction counts as without support."""


@kernel
def push_map(
    J: Array, position: Array, arms: Array, axes: Array, places: Array, out: Array
) -> None:
    """Write where the points are, and the generalised forces of unit forces there.

    A force s at an arm r pushes with (s, r × s): column Jᵀ(s, r × s).

    Args:
        J: Of the contact's frame, world axes, shape (6, nv).
        position: Of its origin [m].
        arms: From there to the points, world axes, shape (k, 3) [m].
        axes: Tangents and normal as columns, world axes, shape (3, 3).
        places: The points in the world, shape (k, 3) [m].
        out: One column an axis, point after point, shape (nv, 3 k).
    """
    for p in range(arms.shape[0]):
        x, y, z = arms[p, 0], arms[p, 1], arms[p, 2]
        for i in range(3):
            places[p, i] = position[i] + arms[p, i]
        for axis in range(3):
            a, b, c = axes[0, axis], axes[1, axis], axes[2, axis]
            d, e, f = y * c - z * b, z * a - x * c, x * b - y * a
            for j in range(J.shape[1]):
                out[j, 3 * p + axis] = (
                    (a * J[0, j] + b * J[1, j] + c * J[2, j])
                    + (d * J[3, j] + e * J[4, j] + f * J[5, j])
                )  # fmt: skip


@kernel
def least_forces(
    push: Array,
    base: Indices,
    ease: Array,
    wanted: Array,
    A: Array,
    G: Array,
    U: Array,
    scratch: Array,
    forces: Array,
    tau: Array,
) -> None:
    """Write the forces of least Σ f²/ease that push the base as wanted, and the rest.

    f = E Aᵀ(A E Aᵀ)⁺ w, A the base's rows of the map. What is wanted lies in the range
    of A: directions without support are left out.

    Args:
        push: Generalised forces of unit forces, shape (nv, size).
        base: The freedoms that no motor moves.
        ease: How readily each force is used, shape (size,).
        wanted: The effort without contacts, shape (nv,).
        A: Scratch, shape (len(base), size).
        G: Scratch, shape (len(base), len(base)).
        U: Scratch, shape (len(base), len(base)).
        scratch: Scratch, shape (2, len(base)).
        forces: Shape (size,) [N].
        tau: The effort that is left to the motors, shape (nv,).
    """
    n, size = base.shape[0], ease.shape[0]
    w, pushed = scratch[0], scratch[1]
    for i in range(n):
        w[i] = wanted[base[i]]
        for k in range(size):
            A[i, k] = push[base[i], k]
    for i in range(n):
        for j in range(i + 1):
            total = 0.0
            for k in range(size):
                total += A[i, k] * ease[k] * A[j, k]
            G[i, j] = G[j, i] = total
    # G is symmetric and not negative: its rows' lengths become its eigenvalues.
    orthogonalise_rows(G, U)
    greatest = 0.0
    for r in range(n):
        square = 0.0
        for i in range(n):
            square += G[r, i] * G[r, i]
        G[r, 0] = np.sqrt(square)
        greatest = max(greatest, G[r, 0])
    multiply(U, w, pushed)
    for r in range(n):
        pushed[r] = pushed[r] / G[r, 0] if G[r, 0] > _KEPT * greatest else 0.0
    multiply_transposed(U, pushed, w)
    multiply_transposed(A, w, forces)
    for k in range(size):
        forces[k] *= ease[k]
    multiply(push, forces, tau)
    for i in range(tau.shape[0]):
        tau[i] = wanted[i] - tau[i]


@kernel
def bears(cone: Array, forces: Array, least: Array, greatest: Array) -> bool:
    """Return whether forces are within cones, cone f ≥ 0, and bounds."""
    inside = True
    for k in range(forces.shape[0]):
        inside = inside and least[k] <= forces[k] <= greatest[k]
    for r in range(cone.shape[0]):
        total = 0.0
        point = r // 4
        for k in range(3 * point, 3 * point + 3):
            total += cone[r, k] * forces[k]
        inside = inside and total >= 0.0
    return inside
