"""What the law does to the null space alone, where a limit binds."""

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import copy, multiply
from hsp_control.edge.step import LawStep
from hsp_control.law.pseudo_inverse import apply_pseudo_inverse


@kernel
def write_self_motions(step: LawStep) -> None:
    """Write P a of a and of a_damped, and K_N P v of both."""
    edge, rows = step.scratch.edge, step.scratch.rows
    n, share = step.v.shape[0], edge.share[0]
    exact, moved = rows[3, :n], rows[4, :n]
    if edge.code[0] == 0:  # there is one law
        copy(step.a, edge.damped)
    _damped_self_motion(step, edge.damped, edge.self_motions[1])
    _damped_self_motion(step, step.v, moved)
    multiply(step.K_N, moved, edge.brakings[1])
    copy(edge.self_motions[1], edge.self_motions[0])
    copy(edge.brakings[1], edge.brakings[0])
    if edge.code[0] == 0 or share == 1.0:
        return
    _self_motion(step, edge.Q, edge.X, edge.exact, exact)
    for i in range(n):
        edge.self_motions[0, i] = exact[i] + share * (
            edge.self_motions[1, i] - exact[i]
        )
    _self_motion(step, edge.Q, edge.X, step.v, moved)
    multiply(step.K_N, moved, exact)
    for i in range(n):
        edge.brakings[0, i] = exact[i] + share * (edge.brakings[1, i] - exact[i])


@kernel
def _damped_self_motion(step: LawStep, x: Array, out: Array) -> None:
    """Write P x, with the inverse of the damped law."""
    if step.scratch.edge.code[0] == 0 or step.alone:
        Q, X = step.scratch.factors
        _self_motion(step, Q, X, x, out)
    else:
        lowered = step.scratch.rows[2, : x.shape[0]]
        multiply(step.metric.W, x, lowered)
        multiply(step.scratch.inner, lowered, out)


@kernel
def _self_motion(step: LawStep, Q: Array, X: Array, x: Array, out: Array) -> None:
    """Write x - J# J x, for an inverse Qᵀ X."""
    J, rows = step.task.jacobian, step.scratch.rows
    m, n = J.shape
    moves, part, back = rows[0, :m], rows[1, :m], rows[2, :n]
    multiply(J, x, moves)
    apply_pseudo_inverse(Q, X, step.metric.L, step.form, moves, part, back)
    for i in range(n):
        out[i] = x[i] - back[i]
