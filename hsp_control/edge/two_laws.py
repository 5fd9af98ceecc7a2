"""The two laws of the edge: one with bounded inverses, and the exact one."""

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import bounded_inverse
from hsp_control.edge.damped_levels import write_damped_levels
from hsp_control.edge.step import LawStep
from hsp_control.edge.threshold import turning_threshold, write_thresholds
from hsp_control.law.hierarchy import LevelScratch
from hsp_control.law.law import acceleration, null_space_command
from hsp_control.law.outcome import BEYOND_ANY_LEVEL
from hsp_control.law.pseudo_inverse import whiten


@kernel
def resolve_at_once(step: LawStep) -> int:
    """Write e_N and a of all tasks at once; write and return the code of `outcome_of`.

    If the tasks of several levels are exact together, they are exact one after the
    other: this is the same then.
    """
    (Q, X), B, a = step.scratch.factors, step.scratch.wide, step.a
    whiten(step.task.jacobian, step.metric.L, step.form, B)
    damped = int(bounded_inverse(B, _write_thresholds(step), Q, X))
    _write_law(step, Q, X, step.e_N)
    step.code[0] = damped if _all_finite(a) else BEYOND_ANY_LEVEL
    return int(step.code[0])


@kernel
def resolve_by_levels(step: LawStep) -> int:
    """Write e_N and a: of all levels at once, or level by level if they conflict.

    The code of `outcome_of` is written and returned.
    """
    task, scratch, damped = step.task, step.scratch, 1
    if task.jacobian.shape[0] <= task.jacobian.shape[1]:
        damped = resolve_at_once(step)
    else:
        whiten(task.jacobian, step.metric.L, step.form, scratch.wide)
        _write_thresholds(step)
    if damped > 0:
        levels = LevelScratch(
            scratch.inner, scratch.tall, scratch.square[2], scratch.square, scratch.rows
        )
        damped = write_damped_levels(
            task, step.field, step.metric, step.form, step.v, step.K_N, step.threshold,
            step.following, step.asked, step.yields, step.springs, step.thresholds,
            step.controls, step.ends, levels, step.e_N, scratch.edge.by_tasks, step.a,
        )  # fmt: skip
        if not _all_finite(step.a):
            damped = BEYOND_ANY_LEVEL
        step.code[0] = damped
    return damped


@kernel
def resolve_exactly(step: LawStep, Q: Array, X: Array, e_N: Array) -> None:
    """Write e_N and a of all tasks at once, whatever they ask for."""
    bounded_inverse(step.scratch.wide, 0.0, Q, X)
    _write_law(step, Q, X, e_N)


@kernel
def _write_law(step: LawStep, Q: Array, X: Array, e_N: Array) -> None:
    """Write e_N and a for an inverse Qᵀ X: equations (13) and (7)."""
    task, metric, form, v = step.task, step.metric, step.form, step.v
    rows = step.scratch.rows
    u = rows[6, : v.shape[0]]
    null_space_command(task, step.field, metric, form, Q, X, v, step.K_N, rows, e_N, u)
    if not step.controls:
        for i in range(u.shape[0]):
            u[i] = 0.0
    acceleration(task, metric.L, form, Q, X, v, u, rows, step.a)


@kernel
def _write_thresholds(step: LawStep) -> float:
    """See `write_thresholds`: J is whitened before."""
    turning = turning_threshold(step.field.g, step.following)
    return write_thresholds(
        step.task.jacobian, step.scratch.wide, step.asked, step.yields, step.pulls,
        step.springs, step.ends, step.threshold, turning, step.following,
        step.thresholds,
    )  # fmt: skip


@kernel
def _all_finite(a: Array) -> bool:
    total = 0.0
    for i in range(a.shape[0]):
        total += a[i]
    return bool(np.isfinite(total))
