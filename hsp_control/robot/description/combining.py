"""Several robots in one workspace, as one model.

Their Jacobians do not mix, so each follows the law as if alone, and each is to the
other an obstacle that moves with its true velocity.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pinocchio as pin

from hsp_control.common.exceptions import ModelError
from hsp_control.robot.description.sources import RobotSource


@dataclass(frozen=True)
class Part:
    """One robot among several.

    Attributes:
        prefix: What its joints' and frames' names begin with, ``left_``.
        source: Where it comes from.
        placement: Where it stands in the world.
    """

    prefix: str
    source: RobotSource
    placement: pin.SE3


def combine(parts: Sequence[tuple[Part, pin.Model]]) -> pin.Model:
    """Return one model of all robots.

    Args:
        parts: Each robot's part and its own model.

    Raises:
        ModelError: If there are fewer than two, prefixes repeat, one consists of
            several already, their gravity differs, or a joint mimics another
            (Pinocchio cannot append it).
    """
    prefixes = [part.prefix for part, _ in parts]
    if len(parts) < 2 or len(set(prefixes)) < len(prefixes):
        raise ModelError(
            f"robots to combine need different names, two or more: got {prefixes}"
        )
    whole = pin.Model()
    for part, model in parts:
        if part.source.origin == "combined":
            raise ModelError(
                f"{part.prefix}{part.source.name}: is combined already; "
                "combine all robots at once"
            )
        if model.nvExtended != model.nv:
            raise ModelError(
                f"{part.prefix}{part.source.name}: joints that mimic others cannot be "
                "combined; lock them, or load with mimic: false"
            )
        own = model.copy()
        for index in range(1, own.njoints):
            own.names[index] = part.prefix + own.names[index]
        for index in range(1, own.nframes):
            own.frames[index].name = part.prefix + own.frames[index].name
        whole = pin.appendModel(whole, own, 0, part.placement)
    if any(model.gravity != parts[0][1].gravity for _, model in parts):
        raise ModelError("robots to combine differ in gravity; load them with the same")
    whole.gravity = parts[0][1].gravity
    return whole


def placement(position: Sequence[float], rpy: Sequence[float]) -> pin.SE3:
    """Return a placement from a position [m] and roll, pitch, yaw [rad]."""
    return pin.SE3(pin.rpy.rpyToMatrix(*rpy), np.asarray(position, dtype=float))
