"""What the law does to the null space alone, where a limit binds.

    a = a_t + φ_N,      φ_N = P u

of each of the two laws. Where an inverse is bounded P is no projector: P a is less than
φ_N, and what is left of it would pass for something that the tasks want.
"""

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import copy, multiply
from hsp_control.edge.step import LawStep
from hsp_control.law.pseudo_inverse import apply_pseudo_inverse


@kernel
def write_self_motions(step: LawStep) -> None:
    """Write φ_N of a and of a_damped, and P K_N P v, what brakes them, of both."""
    edge, rows = step.scratch.edge, step.scratch.rows
    n, share = step.v.shape[0], edge.share[0]
    alone = edge.code[0] == 0 or step.alone  # nothing went level by level
    if edge.code[0] == 0:  # there is one law
        copy(step.a, edge.damped)
    self_motion, braking = edge.self_motions[1], edge.brakings[1]
    if alone:
        Q, X = step.scratch.factors
        _self_motion(step, Q, X, edge.damped, self_motion)
        _braking(step, Q, X, braking)
    else:
        for i in range(n):
            self_motion[i] = edge.damped[i] - edge.by_tasks[i]
        moved, lowered = rows[3, :n], rows[2, :n]
        multiply(step.metric.W, step.v, lowered)
        multiply(step.scratch.inner, lowered, moved)
        multiply(step.K_N, moved, braking)
        multiply(step.metric.W, braking, lowered)
        multiply(step.scratch.inner, lowered, braking)
    copy(self_motion, edge.self_motions[0])
    copy(braking, edge.brakings[0])
    if edge.code[0] == 0 or share == 1.0:
        return
    exact = rows[4, :n]
    _self_motion(step, edge.Q, edge.X, edge.exact, exact)
    for i in range(n):
        edge.self_motions[0, i] = exact[i] + share * (self_motion[i] - exact[i])
    _braking(step, edge.Q, edge.X, exact)
    for i in range(n):
        edge.brakings[0, i] = exact[i] + share * (braking[i] - exact[i])


@kernel
def _self_motion(step: LawStep, Q: Array, X: Array, a: Array, out: Array) -> None:
    """Write a - J# (a_x - J'v), for an inverse Qᵀ X."""
    task, rows = step.task, step.scratch.rows
    m, n = task.jacobian.shape
    missing, part, by_tasks = rows[0, :m], rows[1, :m], rows[2, :n]
    multiply(task.jacobian_dot, step.v, missing)
    for k in range(m):
        missing[k] = task.acceleration[k] - missing[k]
    apply_pseudo_inverse(Q, X, step.metric.L, step.form, missing, part, by_tasks)
    for i in range(n):
        out[i] = a[i] - by_tasks[i]


@kernel
def _braking(step: LawStep, Q: Array, X: Array, out: Array) -> None:
    """Write P K_N P v, for an inverse Qᵀ X."""
    moved = step.scratch.rows[3, : step.v.shape[0]]
    _project(step, Q, X, step.v, moved)
    multiply(step.K_N, moved, out)
    _project(step, Q, X, out, out)


@kernel
def _project(step: LawStep, Q: Array, X: Array, x: Array, out: Array) -> None:
    """Write P x = x - J# J x, perhaps in place, for an inverse Qᵀ X."""
    J, rows = step.task.jacobian, step.scratch.rows
    m, n = J.shape
    moves, part, back = rows[0, :m], rows[1, :m], rows[2, :n]
    multiply(J, x, moves)
    apply_pseudo_inverse(Q, X, step.metric.L, step.form, moves, part, back)
    for i in range(n):
        out[i] = x[i] - back[i]
