"""Random inputs of the law, and its results."""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from hsp_control.common.arrays import Array
from hsp_control.edge import BoundLaw
from hsp_control.engine.plans import planned
from hsp_control.law import IDENTITY, VARYING, Outcome, Problem


def orthogonal(seed: int, n: int, m: int) -> Array:
    rng = np.random.default_rng(seed)
    return np.linalg.qr(rng.standard_normal((n, n)))[0][:, :m]


def positive(seed: int, n: int) -> Array:
    """Return a symmetric positive definite matrix of condition number 100."""
    U = orthogonal(seed, n, n)
    W = (U * np.logspace(-1.0, 1.0, n)) @ U.T
    return 0.5 * (W + W.T)


def jacobian(seed: int, m: int, n: int, values: Any, W: Array) -> Array:
    """Return J with given singular values in the metric, those of J L⁻ᵀ."""
    whitened = (orthogonal(seed, m, m) * values) @ orthogonal(seed + 1, n, m).T
    return whitened @ np.linalg.cholesky(W).T


class Numbers(NamedTuple):
    """The law's input at one state, at random."""

    J: Array
    J_dot: Array
    a_x: Array
    v: Array
    g: Array
    g_dot: Array
    K_N: Array
    W: Array
    W_dot: Array


def numbers(seed: int, m: int, n: int, form: int) -> Numbers:
    rng = np.random.default_rng(seed)
    W, W_dot = np.eye(n), np.zeros((n, n))
    if form != IDENTITY:
        W = positive(seed, n)
    if form == VARYING:
        W_dot = rng.standard_normal((n, n))
        W_dot += W_dot.T
    values = np.linspace(2.0, 0.5, m)
    J = jacobian(seed + 1, m, n, values, W)
    J_dot = rng.standard_normal((m, n))
    K_N = 3.0 * np.eye(n) + rng.standard_normal((n, n))
    return Numbers(
        J,
        J_dot,
        rng.standard_normal(m),
        *rng.standard_normal((3, n)),
        K_N=K_N,
        W=W,
        W_dot=W_dot,
    )


def fill(problem: Problem, x: Numbers) -> None:
    problem.task.jacobian[:], problem.task.jacobian_dot[:] = x.J, x.J_dot
    problem.task.acceleration[:] = x.a_x
    problem.field.g[:], problem.field.g_dot[:] = x.g, x.g_dot
    problem.metric.W[:], problem.metric.W_dot[:] = x.W, x.W_dot
    problem.metric.L[:] = np.linalg.cholesky(x.W)


def resolve(
    x: Numbers,
    form: int,
    *,
    controls: bool = True,
    threshold: float = 0.01,
    levels: Sequence[int] = (),
) -> tuple[Array, Array, bool]:
    """Return the package's acceleration and e_N, and whether it was damped."""
    m, n = x.J.shape
    sizes = levels or [m]
    law = BoundLaw(sizes, n, form, x.K_N, threshold, controls=controls)
    fill(law.problem, x)
    planned([law.call(x.v)]).run(0.0)
    a, e_N = law.acceleration, law.null_space_error
    return a.copy(), e_N.copy(), law.outcome.outcome is Outcome.DAMPED
