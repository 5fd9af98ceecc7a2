"""How well conditioned the mass matrix is."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.inspection.finding import Finding
from hsp_control.robot import Robot

_SAMPLES = 64
_DOUBTFUL = 1e5
"""Condition number above which efforts have few valid digits."""


def worst_condition(robot: Robot) -> tuple[float, str]:
    """Return M's largest condition number, and the dof that moves most without inertia.

    At home and at random configurations; inf where M is not positive definite.
    """
    rng, rest = np.random.default_rng(0), np.zeros(robot.nv)
    worst, which = 0.0, 0
    for sample in range(_SAMPLES + 1):
        q: Array = robot.random_configuration(rng) if sample else robot.home()
        values, vectors = np.linalg.eigh(robot.state(0.0, q, rest).mass_matrix)
        condition = float(values[-1] / values[0]) if values[0] > 0.0 else np.inf
        if condition > worst:
            worst, which = condition, int(np.argmax(np.abs(vectors[:, 0])))
    return worst, robot.dof_names[which]


def check_mass_matrix(condition: float, dof: str) -> Iterator[Finding]:
    """Yield the mass matrix if its `worst_condition` is doubtful."""
    if condition > _DOUBTFUL:
        yield Finding(
            "warning",
            "mass matrix",
            f"joint {dof!r}",
            f"the condition number of M reaches {condition:.1e}: hardly any mass moves "
            "with this joint somewhere"
            if np.isfinite(condition)
            else "M is not positive definite everywhere",
            "check the inertias beyond it, or lock it",
        )
