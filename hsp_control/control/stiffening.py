"""Changes of an impedance that add no energy: they wait where they would.

With E = ½ e'ᵀΛe' + U(e), U the energy of the spring, and an external force f,

    E' = fᵀx' - e'ᵀ(D + D_ζ) e' + ∂U/∂t.

A spring that becomes stiffer while it is stretched stores energy that nobody gave. So
the numbers in force follow those that were planned only as fast as ∂U/∂t is no more
than what the damping takes out: E' <= fᵀx', to first order in the period. Where they
are behind, they catch up in half of the change's ramp, so that no effort jumps.
"""

import numpy as np

from hsp_control.common.arrays import Array, Indices
from hsp_control.control.evolution import Evolution
from hsp_control.tasks import Task
from hsp_control.tasks.compliant_task import impedance_of
from hsp_control.tasks.impedance import parts_of
from hsp_control.tasks.slipping import spring_force


def changes_impedance(task: Task, numbers: Evolution[Array]) -> bool:
    """Return whether a task has an impedance that changes."""
    return impedance_of(task) is not None and not numbers.constant


def next_numbers(
    now: Array,
    planned: Evolution[Array],
    ends: Indices,
    mobility: Array,
    e: Array,
    e_dot: Array,
    t: float,
    period: float,
) -> Array | None:
    """Return the numbers of an impedance for the next period."""
    then = planned.at(t + period)
    step = then - now
    if not np.allclose(now, planned.at(t), rtol=1e-4, atol=1e-9):  # it has waited
        begun = [each.ramp for each in planned.transitions if each.start <= t]
        step *= min(2.0 * period / max(begun[-1] if begun else 0.3, period), 1.0)
    needed = spring_energy(now + step, ends, e) - spring_energy(now, ends, e)
    if needed > 0.0:
        given = period * dissipated(now, mobility, e_dot)
        if needed > given:
            return np.asarray(now + given / needed * step)
    return None if np.array_equal(now + step, then) else now + step


def spring_energy(numbers: Array, ends: Indices, e: Array) -> float:
    """Return U(e) = sᵀe - ½ sᵀK⁻¹s: ½ eᵀK e, and linear where s is at its bound."""
    force = spring_force(numbers, ends, e)
    return float(force @ e - 0.5 * force @ np.linalg.solve(parts_of(numbers)[0], force))


def dissipated(numbers: Array, mobility: Array, e_dot: Array) -> float:
    """Return e'ᵀ(D + D_ζ) e' [W], with D_ζ = 2 ζ C S⁻¹ Cᵀ, K = C Cᵀ, S² = Cᵀ Λ⁻¹ C."""
    K, D, ratio, *_ = parts_of(numbers)
    power = float(e_dot @ D @ e_dot)
    if ratio[0] > 0.0:
        C = np.linalg.cholesky(K)
        squares, modes = np.linalg.eigh(C.T @ mobility @ C)
        along = modes.T @ C.T @ e_dot
        frequencies = np.sqrt(np.maximum(squares, np.finfo(float).tiny))
        # Where the arm has no mobility it does not move.
        power += float(2.0 * ratio[0] * (along**2 / frequencies).sum())
    return power
