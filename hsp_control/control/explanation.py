"""What explains a step: its flow, and what made it fail."""

from typing import NoReturn

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.common.exceptions import NonFiniteError
from hsp_control.control.active_stack import ActiveStack
from hsp_control.law import CONSTANT, Resolution
from hsp_control.null_space.fields import NullSpaceField
from hsp_control.null_space.metrics import Metric
from hsp_control.robot import RobotState


def flow_of(
    active: ActiveStack, state: RobotState, metric: Metric, threshold: float
) -> Array:
    """Return J# x_d' + P g, shape (nv,), of a stack resolved at a state at rest."""
    problem, nv = active.resolution.problem, state.robot.nv
    # At rest, without drift and with unit gain the law's acceleration is the flow.
    flow = Resolution(
        np.diff(active.resolution.ends, prepend=0).tolist(),
        nv,
        min(metric.form, CONSTANT),
        np.eye(nv),
        threshold,
    )
    flow.problem.task.jacobian[:] = active.rows.jacobian
    for level in active.levels:
        for task in level:
            rate = task.reference_rate(state)
            flow.problem.task.acceleration[active.task_rows[task.name]] = rate
    flow.problem.field.g[:] = problem.field.g
    flow.problem.metric.W[:], flow.problem.metric.L[:] = problem.metric[:2]
    return flow.resolve(state.v).acceleration


def raise_not_finite(
    active: ActiveStack, state: RobotState, field: NullSpaceField, metric: Metric
) -> NoReturn:
    """Say what made a step's effort NaN or infinite."""
    part = active.not_finite()
    if part is not None:
        raise NonFiniteError(
            f"{part} is not finite at t = {state.t:.6g} s; "
            "does its trajectory return NaN or infinity there?"
        )
    problem = active.resolution.problem
    if not all(np.isfinite(array).all() for array in problem.field):
        raise NonFiniteError(
            f"field {field.name!r} is not finite at t = {state.t:.6g} s"
        )
    metric.evaluate(state, problem.metric)  # may say what is wrong
    raise NonFiniteError(
        f"the effort is not finite at t = {state.t:.6g} s, "
        f"q = {state.q.tolist()}, v = {state.v.tolist()}"
    )
