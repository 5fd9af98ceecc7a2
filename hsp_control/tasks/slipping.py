"""A spring with a bounded force, which slips at its largest force.

The mathematics is that of ``engine/tasks/slipping.hpp``.
"""

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array, Indices
from hsp_control.tasks.impedance import parts_of


def spring_force(numbers: Array, ends: Indices, e: Array) -> Array:
    """Return s(e), shape (m,) [N or N·m].

    Args:
        numbers: As of `Impedance.numbers`, shape (2 m + 2, m).
        ends: Ends of the parts of the error, shape (parts,).
        e: The error, shape (m,).
    """
    e = np.ascontiguousarray(e, dtype=float)
    S = np.zeros((len(e), len(e)))
    engine.SpringStiffness(impedance=parts_of(numbers), ends=ends, e=e, S=S)()
    return np.asarray(S @ e)


def slipped(numbers: Array, ends: Indices, e: Array) -> float:
    """Return the length of the longest part of the error for which the spring slips.

    Returns:
        Its length [m or rad]; 0 if the force is K e.
    """
    K, _, _, inverse_force = parts_of(numbers)
    force, away, first = K @ e, 0.0, 0
    for end in ends:
        here = slice(first, end)
        if np.linalg.norm(force[here]) * inverse_force[first] > 1.0:
            away = max(away, float(np.linalg.norm(e[here])))
        first = end
    return away
