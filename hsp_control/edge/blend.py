"""The blend of the two laws: a = a_exact + μ (a_damped - a_exact)."""

from hsp_control.compiled.kernels import kernel
from hsp_control.compiled.linalg import copy
from hsp_control.edge.shares import far_share, near_share
from hsp_control.edge.step import LawStep
from hsp_control.edge.two_laws import (
    resolve_at_once,
    resolve_by_levels,
    resolve_exactly,
)
from hsp_control.law.outcome import BEYOND_ANY_LEVEL


@kernel
def resolve_stack(step: LawStep) -> int:
    """Resolve the tasks of one level; see `_blended`."""
    return _blended(step, resolve_at_once(step))


@kernel
def resolve_priorities(step: LawStep) -> int:
    """Resolve the tasks of several levels; see `_blended`."""
    return _blended(step, resolve_by_levels(step))


@kernel
def _blended(step: LawStep, damped: int) -> int:
    """Overwrite a_damped by a, and e_N; write and return the code of `outcome_of`.

    The first two shares of `shares.py` count here.
    """
    edge, a, e_N = step.scratch.edge, step.a, step.e_N
    edge.code[0] = damped
    if damped == 0:
        edge.share[0] = 0.0
        return damped
    n = a.shape[0]
    copy(a, edge.damped)
    edge.share[0] = 1.0
    if damped >= BEYOND_ANY_LEVEL or not step.exact_beside:
        return damped
    share = far_share(step.stretched)
    if share < 1.0:
        J, size = step.task.jacobian, step.following.size
        near = near_share(J, size, step.threshold, edge.turned)
        share = max(share, near)
    if share == 1.0:
        return damped
    edge.share[0] = share
    resolve_exactly(step, edge.Q, edge.X, edge.exact_e_N)
    copy(a, edge.exact)
    for i in range(n):
        a[i] += share * (edge.damped[i] - a[i])
        e_N[i] = edge.exact_e_N[i] + share * (e_N[i] - edge.exact_e_N[i])
    if share == 0.0:
        step.code[0] = 0
    return int(step.code[0])
