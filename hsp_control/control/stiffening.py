"""Changes of an impedance that add no energy: they wait where they would.

With E = ½ e'ᵀΛe' + U(e), U the energy of the spring, and an external force f,

    E' = fᵀx' - e'ᵀ(D + D_ζ) e' + ∂U/∂t.

A spring that becomes stiffer while it is stretched stores energy that nobody gave. So
a change proceeds only as fast as ∂U/∂t is no more than what the damping takes out:
E' <= fᵀx', to first order in the period.
"""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.control.evolution import Evolution
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.impedance import parts_of


def changes_impedance(task: Task, numbers: Evolution[Array]) -> bool:
    """Return whether a task has an impedance that changes."""
    return impedance_of(task) is not None and not numbers.constant


def waiting_time(
    numbers: Evolution[Array],
    mobility: Array,
    e: Array,
    e_dot: Array,
    t: float,
    period: float,
    behind: float,
) -> float:
    """Return how far a change is behind its own time after the next period [s].

    Args:
        numbers: The numbers of the impedance, as they were planned.
        mobility: Λ⁻¹, shape (m, m).
        e: Error, shape (m,).
        e_dot: Its rate, shape (m,) [1/s].
        t: Time [s].
        period: Time until the next effort [s].
        behind: How far it is behind now [s].
    """
    if t - behind >= numbers.end:
        return 0.0  # complete
    now, then = numbers.at(t - behind), numbers.at(t - behind + period)
    needed = spring_energy(then, e) - spring_energy(now, e)
    given = period * dissipated(now, mobility, e_dot)
    if needed <= given:
        return behind
    return behind + (1.0 - given / needed) * period


def spring_energy(numbers: Array, e: Array) -> float:
    """Return U(e): ½ eᵀK e, and linear beyond the largest error."""
    K, _, _, inverse_bound = parts_of(numbers)
    if not inverse_bound.any():
        return float(0.5 * e @ K @ e)
    away = np.abs(e)
    with np.errstate(divide="ignore"):
        bound = np.where(inverse_bound > 0.0, 1.0 / inverse_bound, np.inf)
    inside = np.minimum(away, bound)
    return float(np.diag(K) @ (inside * (away - 0.5 * inside)))


def dissipated(numbers: Array, mobility: Array, e_dot: Array) -> float:
    """Return e'ᵀ(D + D_ζ) e' [W], with D_ζ = 2 ζ C S⁻¹ Cᵀ, K = C Cᵀ, S² = Cᵀ Λ⁻¹ C."""
    K, D, ratio, _ = parts_of(numbers)
    power = float(e_dot @ D @ e_dot)
    if ratio[0] > 0.0:
        C = np.linalg.cholesky(K)
        squares, modes = np.linalg.eigh(C.T @ mobility @ C)
        along = modes.T @ C.T @ e_dot
        frequencies = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        # Where the arm has no mobility it does not move.
        power += float(2.0 * ratio[0] * (along**2 / frequencies).sum())
    return power
