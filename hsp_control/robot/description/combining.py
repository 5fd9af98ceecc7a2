"""Combine several robots in one workspace into one model.

Their Jacobians are decoupled, so each robot follows the control law as if it were
alone. For collision avoidance each robot is an obstacle for the others, and its true
velocity is known.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from hsp_control.common.exceptions import ModelError
from hsp_control.declaration.rotation import matrix_of
from hsp_control.robot.description.sources import RobotSource


@dataclass(frozen=True)
class Part:
    """One robot of a combined robot."""

    prefix: str  # the names of its joints and frames begin with this, e.g. ``left_``
    source: RobotSource  # where the robot comes from
    placement: pin.SE3  # placement of its root in the world


def combine(parts: Sequence[tuple[Part, pin.Model]]) -> pin.Model:
    """Return one model that contains all robots, which have no mimic joints."""
    prefixes = [part.prefix for part, _ in parts]
    if len(parts) < 2 or len(set(prefixes)) < len(prefixes):
        raise ModelError(
            "robots to combine must be two or more, with different names; got prefixes "
            f"{prefixes}"
        )
    whole = pin.Model()
    for part, model in parts:
        if part.source.origin == "combined":
            raise ModelError(
                f"{part.prefix}{part.source.name} is already a combined robot; "
                "combine all robots in one call"
            )
        if model.nvExtended != model.nv:
            raise ModelError(
                f"{part.prefix}{part.source.name}: a robot with mimic joints cannot be "
                "combined; lock these joints, or load the robot with mimic=False"
            )
        own = model.copy()
        for index in range(1, own.njoints):
            own.names[index] = part.prefix + own.names[index]
        for index in range(1, own.nframes):
            own.frames[index].name = part.prefix + own.frames[index].name
        whole = pin.appendModel(whole, own, 0, part.placement)
    if any(model.gravity != parts[0][1].gravity for _, model in parts):
        raise ModelError("robots to combine differ in gravity; load all with one value")
    whole.gravity = parts[0][1].gravity
    return whole


def placement(position: ArrayLike, rotation: ArrayLike) -> pin.SE3:
    """Return a placement from a position [m], shape (3,), and a `Rotation`."""
    return pin.SE3(matrix_of(rotation), np.asarray(position, dtype=float))
