"""This package: `hsp_control.Controller`, as a user calls it."""

from collections.abc import Callable

import hsp_control as hsp
from hsp_control.common.arrays import Array
from shared.cases import FRAME, Case

Reads = Callable[[hsp.Controller], object]
"""The quantities read from a controller after a step."""


def make(
    case: Case,
    field: hsp.NullSpaceField | None = None,
    metric: hsp.metrics.Metric | None = None,
    *,
    reads: Reads | None = None,
) -> Callable[[float, Array, Array], Array]:
    """Return the controller, with another field or metric if given.

    Like its peers it has effort limits; it has limits of position and speed, too.
    """
    robot = case.robot
    task: hsp.Task
    if case.rows == 6:
        task = hsp.FramePose(FRAME, case.trajectory, gains=case.gains)
    else:
        task = hsp.FramePosition(FRAME, case.trajectory.position, gains=case.gains)
    controller = hsp.Controller(
        robot,
        [task],
        field or case.field,
        null_space_gain=case.null_space_gain,
        metric=metric,
        limits=hsp.Limits(),
    )

    def compute(t: float, q: Array, v: Array) -> Array:
        return controller.compute(t, q, v).tau

    compute.controller = controller  # type: ignore[attr-defined]
    if reads is None:
        return compute

    def compute_and_read(t: float, q: Array, v: Array) -> Array:
        tau = compute(t, q, v)
        reads(controller)
        return tau

    return compute_and_read
