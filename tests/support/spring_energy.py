"""Energies of a spring, and passive changes of it, in plain NumPy."""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.slipping import spring_force


def next_numbers(
    now: Array,
    planned: Array,
    then: Array,
    ends: Indices,
    mobility: Array,
    e: Array,
    e_dot: Array,
    ramp: float,
    period: float,
) -> tuple[Array, bool]:
    """Return the matrices of an impedance for the next period; whether it waits."""
    step = then - now
    if not np.allclose(now, planned, rtol=1e-4, atol=1e-9):  # it has waited
        step *= min(2.0 * period / max(ramp, period), 1.0)
    needed = spring_energy(now + step, ends, e) - spring_energy(now, ends, e)
    given = period * dissipated(now, mobility, e_dot)
    if needed > 0.0 and needed > given:
        return now + given / needed * step, True
    return now + step, not np.array_equal(now + step, then)


def spring_energy(numbers: Array, ends: Indices, e: Array) -> float:
    """Return U(e) = sᵀe - ½ sᵀK⁺s: ½ eᵀK e, and linear where s is at its bound."""
    force = spring_force(numbers, ends, e)
    length = np.linalg.pinv(parts_of(numbers).K, hermitian=True) @ force
    return float(force @ e - 0.5 * force @ length)


def dissipated(numbers: Array, mobility: Array, e_dot: Array) -> float:
    """Return e'ᵀ(D + D_ζ) e' [W], with D_ζ = 2 ζ C S⁻¹ Cᵀ, K = C Cᵀ, S² = Cᵀ Λ⁻¹ C."""
    K, D, ratio, *_ = parts_of(numbers)
    power = float(e_dot @ D @ e_dot)
    if ratio[0] > 0.0:
        stiffness, axes = np.linalg.eigh(K)
        C = axes * np.sqrt(np.maximum(stiffness, 0.0))
        squares, modes = np.linalg.eigh(C.T @ mobility @ C)
        along = modes.T @ C.T @ e_dot
        frequencies = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        power += float(2.0 * ratio[0] * (along**2 / frequencies).sum())
    return power
