"""A spring whose force is bounded, as if it slipped where it pulls with the most.

Let each group of rows g, such as the position, carry no more than F_g. The spring slips
by x, as it does at a friction that is F_g in every direction, and K (e - x) pulls:

    U(e) = min_x ½ (e - x)ᵀ K (e - x) + Σ F_g |x_g|
    s(e) = ∂U/∂e = S e,    S = (K⁻¹ + diag(c))⁻¹,    c ≥ 0

with one number c in each group, 0 unless |s_g| = F_g. U is convex, ½ eᵀK e where no
force is at its bound, and grows linearly far away, so that the bounded force is
conservative for every stiffness. Each c is where a Newton iteration on 1/|s_g|
ends, as for the radius of a trust region: one step if the group's stiffness is one
number.
"""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import cholesky, solve_columns

_TOLERANCE = 1e-11  # of |s_g|, relative to F_g
_STEPS = 40  # of Newton, and sweeps over the groups where K couples them


def spring_force(numbers: Array, ends: Indices, e: Array) -> Array:
    """Return s(e), shape (m,) [N or N·m]; arguments as of `bounded_stiffness`."""
    m = len(e)
    S, square, vectors = numbers[:m].copy(), np.zeros((3, m, m)), np.zeros((3, m))
    bounded_stiffness(numbers, ends, e, square, vectors, S)
    return np.asarray(S @ e)


def slipped(numbers: Array, ends: Indices, e: Array) -> float:
    """Return how long the error is where the spring slips, of its longest part.

    Returns:
        Its length [m or rad]; 0 if the force is K e.
    """
    force, away = numbers[: len(e)] @ e, 0.0
    for g in range(len(ends)):
        first, end, most = group_of(g, ends, numbers)
        if length(force, first, end) > most:
            away = max(away, length(e, first, end))
    return away


@kernel
def write_pulls(numbers: Array, ends: Indices, e: Array, out: Array) -> None:
    """Write (K e)_i/F_g, shape (m,); 0 where there is no bound."""
    for i in range(e.shape[0]):
        out[i] = 0.0
        for j in range(e.shape[0]):
            out[i] += numbers[i, j] * e[j]
    for g in range(ends.shape[0]):
        first, end, most = group_of(g, ends, numbers)
        for i in range(first, end):
            out[i] /= most


@kernel
def group_of(g: int, ends: Indices, numbers: Array) -> tuple[int, int, float]:
    """Return a group's first row, the row after its last, and F_g; inf for no bound."""
    first = 0 if g == 0 else ends[g - 1]
    inverse = numbers[2 * numbers.shape[1] + 1, first]
    return first, ends[g], 1.0 / inverse if inverse > 0.0 else np.inf


@kernel
def length(x: Array, first: int, end: int) -> float:
    """Return the length of some entries of x."""
    square = 0.0
    for i in range(first, end):
        square += x[i] * x[i]
    return float(np.sqrt(square))


@kernel
def bounded_stiffness(
    numbers: Array, ends: Indices, e: Array, square: Array, vectors: Array, S: Array
) -> bool:
    """Write S where a bound acts; return whether one does, else S is K.

    Args:
        numbers: As of `Impedance.numbers`, shape (2 m + 2, m).
        ends: Where each part of the error ends, shape (parts,).
        e: The error, shape (m,).
        square: Scratch, shape (3, m, m).
        vectors: Scratch, shape (3, m).
        S: Shape (m, m).
    """
    m = e.shape[0]
    groups = ends.shape[0]
    K, force = numbers[:m], vectors[0]
    for i in range(m):
        force[i] = 0.0
        for j in range(m):
            force[i] += K[i, j] * e[j]
    acts = False
    for g in range(groups):
        first, end, most = group_of(g, ends, numbers)
        acts = acts or length(force, first, end) > most
    if not acts:
        return False
    inverse, L = square[0], square[1]
    if not cholesky(K, L):
        return False
    _write_inverse(L, inverse)
    c = vectors[2]  # of the groups
    c[:] = 0.0
    for _ in range(_STEPS):
        settled = True
        for g in range(groups):
            first, end, most = group_of(g, ends, numbers)
            if most == np.inf:
                continue
            for _step in range(_STEPS):
                _factorise(inverse, ends, c, square[2], L)
                n = _solve(L, e, force, vectors[1], first, end)
                if n <= most * (1.0 + _TOLERANCE) and (
                    c[g] == 0.0 or n >= most * (1.0 - _TOLERANCE)
                ):
                    break
                settled = False
                slope = 0.0
                for i in range(first, end):
                    slope += force[i] * vectors[1, i]
                c[g] = max(c[g] + (n / most - 1.0) * n * n / slope, 0.0)
        if settled:
            break
    _factorise(inverse, ends, c, square[2], L)
    _write_inverse(L, S)
    return True


@kernel
def _factorise(inverse: Array, ends: Indices, c: Array, A: Array, L: Array) -> None:
    """Write the Cholesky factor of A = K⁻¹ + diag(c)."""
    m, first = inverse.shape[0], 0
    for i in range(m):
        for j in range(m):
            A[i, j] = inverse[i, j]
    for p in range(ends.shape[0]):
        for i in range(first, ends[p]):
            A[i, i] += c[p]
        first = ends[p]
    cholesky(A, L)


@kernel
def _solve(
    L: Array, e: Array, force: Array, change: Array, first: int, end: int
) -> float:
    """Write s = A⁻¹e and -∂s/∂c of a group, A = L Lᵀ; return |s_g|."""
    m = e.shape[0]
    for i in range(m):
        force[i] = e[i]
    solve_columns(L, force.reshape(m, 1))
    for i in range(m):
        change[i] = force[i] if first <= i < end else 0.0
    solve_columns(L, change.reshape(m, 1))
    return length(force, first, end)


@kernel
def _write_inverse(L: Array, out: Array) -> None:
    """Write (L Lᵀ)⁻¹."""
    m = L.shape[0]
    for i in range(m):
        for j in range(m):
            out[i, j] = 1.0 if i == j else 0.0
    solve_columns(L, out)
