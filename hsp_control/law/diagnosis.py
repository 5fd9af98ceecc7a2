"""The distance of the law from a singular posture."""

from math import isqrt

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array


def singular_values(triangle: bytes) -> Array:
    """Return the singular values of J L⁻ᵀ, the largest first, shape (min(m, nv),).

    Args:
        triangle: The result of `BoundLaw.diagnosis`, as bytes.
    """
    T = np.frombuffer(triangle).copy()
    values = np.zeros(isqrt(len(T)))
    engine.SingularValues(T=T.reshape(len(values), len(values)), values=values)()
    return values
