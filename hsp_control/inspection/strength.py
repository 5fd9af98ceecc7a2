"""Whether the motors can hold the robot at rest."""

from collections.abc import Iterator

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.inspection.checks import Finding
from hsp_control.robot import Robot


def too_weak(robot: Robot, q: Array, limits: Array) -> Iterator[tuple[str, str]]:
    """Yield the joints that cannot hold the robot at a configuration, and why."""
    rest = np.zeros(robot.nv)
    static = np.abs(robot.inverse_dynamics(q, rest, rest))
    for k in np.flatnonzero(static > limits):
        unit = "N·m" if robot.units[k] == "rad" else "N"
        yield (
            f"joint {robot.dof_names[k]!r}",
            f"gravity asks {static[k]:.3g} {unit} of it, its limit is {limits[k]:.3g}",
        )


def check_strength(robot: Robot) -> Iterator[Finding]:
    """Yield the joints whose limits are too low to hold the robot at home."""
    if robot.unactuated:
        return
    own = np.array(robot.model.effortLimit)
    limits = np.where(own > 0.0, own, np.inf)
    for joint, why in too_weak(robot, robot.home(), limits):
        cure = "begin elsewhere, or set its limit: limits: {effort: {joints: ...}}"
        yield Finding("warning", "effort", joint, f"at home {why}", cure)
