"""The effort within a robot's rates whose acceleration is nearest to another's."""

import numpy as np

from hsp_control import engine
from hsp_control.common.arrays import Array

_SWEEPS = 30
"""Maximum number of sweeps that adapt each joint's effort to the others."""
_NEAR = 1e-10
"""Change of a sweep that is negligible, relative to the first one."""


def nearest_effort(
    wanted: Array, least: Array, most: Array, inertia: Array
) -> Array | None:
    """Return the effort within bounds whose acceleration is nearest to that of another.

    It minimizes aᵀ M a, where a = M⁻¹ (tau - wanted) is the deviation of the
    acceleration. If a heavy joint's effort lags behind, a light joint, whose effort can
    follow, keeps its desired acceleration; with clipping joint by joint it would be
    accelerated.

    Args:
        wanted: The unlimited effort, shape (nv,) [N·m or N].
        least: The least effort of each joint, shape (nv,).
        most: The greatest effort, shape (nv,).
        inertia: The mass matrix M, shape (nv, nv).

    Returns:
        The effort, shape (nv,); None if M has no inverse.
    """
    try:
        inverse: Array = np.linalg.inv(inertia).astype(float)
    except np.linalg.LinAlgError:
        return None
    nearest = np.empty(wanted.size)
    engine.NearestEffort(
        inverse=inverse,
        wanted=np.asarray(wanted),
        least=np.asarray(least),
        most=np.asarray(most),
        nearest=nearest,
        sweeps=_SWEEPS,
        small=_NEAR,
    )()
    return nearest if np.isfinite(nearest).all() else None
