"""Plain NumPy forms of the package's mathematics, and differences: oracles.

Independent of the package and not optimised: formulas are those of `law.md` or of the
paper, with explicit inverses.

References:
    P. Hsu, J. Hauser, S. Sastry, "Dynamic Control of Redundant Manipulators", Journal
    of Robotic Systems 6(2), 133-148, 1989.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def close(actual: Array, expected: Array, atol: float) -> None:
    """Assert that numbers are equal to an absolute tolerance."""
    np.testing.assert_allclose(actual, expected, rtol=0, atol=atol)


def slope(function: Callable[[float], Any], step: float) -> Array:
    """Return f'(0) by six points: truncation h⁶ f⁽⁷⁾/140, rounding about 2 ε|f|/h."""
    weights = ((1.0, 45.0), (2.0, -9.0), (3.0, 1.0))
    total = 0.0
    for k, weight in weights:
        # Copies, since functions may return arrays that they overwrite later.
        ahead = np.array(function(k * step), dtype=float)
        behind = np.array(function(-k * step), dtype=float)
        total = total + weight * (ahead - behind)
    return np.asarray(total / (60.0 * step))


def gradient(function: Callable[[Array], float], size: int, step: float) -> Array:
    """Return ∇f(0) of a function of Rⁿ, by `slope` per component."""
    return np.array(
        [slope(lambda s, u=unit: function(s * u), step) for unit in np.eye(size)]
    )


def pseudo_inverse(J: Array, W: Array) -> Array:
    """Return J# = W⁻¹Jᵀ(JW⁻¹Jᵀ)⁻¹, for J of full row rank."""
    W_inverse = np.linalg.inv(W)
    return W_inverse @ J.T @ np.linalg.inv(J @ W_inverse @ J.T)


def bounded_pseudo_inverse(J: Array, W: Array, threshold: float) -> Array:
    """Return J# with J's spectrum in the metric inverted by s χ(s²), for any rank.

    χ(λ) = 1/λ from threshold² on, (2 - λ/threshold²)/threshold² below:
    ``docs/law.md``, Near singularities.
    """
    L = np.linalg.cholesky(W)
    U, s, Vt = np.linalg.svd(J @ np.linalg.inv(L).T, full_matrices=False)
    floor = threshold**2
    q = np.where(s >= threshold, 1.0 / np.maximum(s, threshold) ** 2, 0.0)
    q = np.where(s < threshold, (2.0 - s**2 / floor) / floor, q)
    return np.linalg.inv(L).T @ (Vt.T * (s * q)) @ U.T


class Law(NamedTuple):
    """The law's result at one state."""

    acceleration: Array
    null_space_error: Array
    null_space_acceleration: Array
    """φ_N."""


def law(
    J: Array,
    J_dot: Array,
    a_x: Array,
    v: Array,
    g: Array,
    g_dot: Array,
    K_N: Array,
    W: Array,
    W_dot: Array,
) -> Law:
    """Return the law over a metric in the short form of ``docs/law.md``."""
    W_inverse = np.linalg.inv(W)
    Lambda = np.linalg.inv(J @ W_inverse @ J.T)
    J_sharp = W_inverse @ J.T @ Lambda
    P = np.eye(len(v)) - J_sharp @ J
    x = g - v
    e_N = P @ x
    bend = W_inverse @ (J_dot.T @ Lambda @ J - W_dot @ J_sharp @ J) @ x
    phi_N = P @ (g_dot + K_N @ e_N - bend + 0.5 * W_inverse @ W_dot @ e_N)
    return Law(J_sharp @ (a_x - J_dot @ v) + phi_N, e_N, phi_N)


def paper_law(
    J: Array,
    J_dot: Array,
    J_plus_dot: Array,
    a_x: Array,
    v: Array,
    g: Array,
    g_dot: Array,
    K_N: Array,
) -> Law:
    """Return equations (7) and (13) as printed; (J⁺)' comes from elsewhere.

    φ_N = (I - J⁺J)(g' + K_N e_N) - (J⁺J'J⁺ + (J⁺)')J(g - v).
    """
    J_plus = np.linalg.pinv(J)
    P = np.eye(len(v)) - J_plus @ J
    e_N = P @ (g - v)
    turning = (J_plus @ J_dot @ J_plus + J_plus_dot) @ J
    phi_N = P @ (g_dot + K_N @ e_N) - turning @ (g - v)
    return Law(J_plus @ (a_x - J_dot @ v) + phi_N, e_N, phi_N)
