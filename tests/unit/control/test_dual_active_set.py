"""The QP solver: optimality, two other solvers, warm starts, soft rows, status
codes."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from qp_cases import (
    KINDS,
    Case,
    answer,
    by_daqp,
    cost,
    defect,
    degenerate,
    dense,
    infeasible,
    packed,
)

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.control.actuation.dual_active_set import (
    EXHAUSTED,
    INFEASIBLE,
    QP,
    SOLVED,
    Workspace,
)

seeds = st.integers(0, 2**32 - 1)
EACH = 150
"""QPs per kind."""


# --- optima --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_many_of_each_kind(kind: str) -> None:
    """Solved where feasible; answers satisfy the KKT conditions and agree with DAQP."""
    for seed in range(EACH):
        case = KINDS[kind](np.random.default_rng(seed))
        found = answer(case)
        assert found.code == (SOLVED if case.feasible else INFEASIBLE), seed
        assert found.iterations <= 5 * len(case.rows), seed
        if case.feasible:
            assert defect(case, found) < 1e-8, seed
        x = by_daqp(case)
        assert (x is not None) == case.feasible, seed
        if x is not None:
            least = cost(case, found.x)
            assert abs(cost(case, x) - least) < 1e-8 * max(1.0, least), seed


@given(seeds, st.floats(-4.0, 4.0))
def test_the_scale_of_a_row_does_not_matter(seed: int, exponent: float) -> None:
    case = degenerate(np.random.default_rng(seed))
    k = len(case.A)
    scale = np.ones(len(case.rows))
    scale[: k // 2] = 10.0**exponent
    scaled = case._replace(
        A=scale[:k, None] * case.A, lower=scale * case.lower, upper=scale * case.upper
    )
    x = answer(scaled).x
    np.testing.assert_allclose(answer(case).x, x, rtol=0, atol=1e-9)


# --- warm starts ---------------------------------------------------------------------


@given(st.sampled_from(sorted(set(KINDS) - {"infeasible"})), seeds)
def test_any_warm_start_gives_the_same(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = KINDS[kind](rng)
    cold, work = answer(case), Workspace.of(len(case.x0), len(case.A))
    work.held[:] = rng.integers(-1, 2, len(work.held))
    warm = answer(case, work=work)
    assert warm.code == SOLVED
    if set(warm.active) == set(cold.active):  # bit for bit
        np.testing.assert_array_equal(warm.x, cold.x)
    tolerance = 1e-8 * (1.0 + np.abs(cold.x).max())
    np.testing.assert_allclose(warm.x, cold.x, rtol=0, atol=tolerance)
    assert defect(case, warm) < 1e-8


@given(seeds)
def test_a_warm_start_from_the_answer_takes_no_iteration(seed: int) -> None:
    case = dense(np.random.default_rng(seed))
    work = Workspace.of(len(case.x0), len(case.A))
    answer(case, work=work)
    again = answer(case, work=work)
    assert again.code == SOLVED
    assert again.iterations == 0


def test_a_contradiction_that_stays_is_found_at_once() -> None:
    """A warm start begins with the active set that contradicted the last constraint.

    Except where that set has nearly dependent rows.
    """
    iterations = []
    for seed in range(EACH):
        case = infeasible(np.random.default_rng(seed))
        work = Workspace.of(len(case.x0), len(case.A))
        for _ in range(2):
            found = answer(case, work=work)
            assert found.code == INFEASIBLE
        iterations.append(found.iterations)
    assert np.mean(np.array(iterations) <= 1) > 0.8


# --- soft constraints ----------------------------------------------------------------


def with_slacks(case: Case, softness: Array) -> Case:
    """Return the same problem with each slack as one more unknown, and hard rows."""
    n, soft = len(case.x0), np.flatnonzero(softness)
    JT = np.zeros((len(case.JT) + len(soft), n + len(soft)))
    JT[: len(case.JT), :n] = case.JT
    JT[len(case.JT) :, n:] = np.diag(softness[soft])
    A = np.hstack([case.rows, np.eye(len(softness))[:, soft]])
    free = np.full(n + len(soft), np.inf)
    lower, upper = (
        np.concatenate(x) for x in ((case.lower, -free), (case.upper, free))
    )
    x0 = np.concatenate([case.x0, np.zeros(len(soft))])
    return Case(JT, A, lower, upper, 0, x0)


@pytest.mark.parametrize("kind", ["dense", "degenerate", "infeasible", "uncoupled"])
@given(seeds)
def test_a_slack_is_one_more_unknown(kind: str, seed: int) -> None:
    """The same x as DAQP's with all slacks; half of the constraints are soft.

    Where the hard ones are infeasible both report it.
    """
    rng = np.random.default_rng(seed)
    case = KINDS[kind](rng)._replace(equalities=0)
    count = len(case.rows)
    softness = 10.0 ** rng.uniform(-2.0, 0.0, count) * (rng.random(count) < 0.5)
    found = answer(case, softness)
    x = by_daqp(with_slacks(case, softness))
    assert found.code == (INFEASIBLE if x is None else SOLVED)
    if x is not None:
        own = x[: len(case.x0)]
        tolerance = 1e-7 * (1.0 + np.abs(own).max())
        np.testing.assert_allclose(found.x, own, rtol=0, atol=tolerance)


@given(seeds)
def test_a_contradiction_is_shared_by_the_costs(seed: int) -> None:
    """x ≥ 1 and x ≤ -1, with stiff slacks: violations are in proportion to σ²."""
    weight = np.random.default_rng(seed).uniform(0.1, 10.0)
    A = np.array([[1.0, 0.0], [1.0, 0.0]])
    case = two(A, np.array([1.0, -np.inf]), np.array([np.inf, -1.0]))
    assert answer(case).code == INFEASIBLE
    found = answer(case, 1e-4 * np.array([1.0, np.sqrt(weight), 0.0, 0.0]))
    assert found.code == SOLVED
    violations = np.array([1.0 - found.x[0], found.x[0] + 1.0])
    expected = 2.0 * np.array([1.0, weight]) / (1.0 + weight)
    np.testing.assert_allclose(violations, expected, rtol=1e-6)


@given(seeds)
def test_a_soft_answer_does_not_depend_on_its_start(seed: int) -> None:
    """Slacks are reset, too: the same bits, with the same active set."""
    rng = np.random.default_rng(seed)
    case = dense(rng)
    softness = 10.0 ** rng.uniform(-2.0, 0.0, len(case.rows))
    cold = answer(case, softness)
    work = Workspace.of(len(case.x0), len(case.A), soft=True)
    work.held[:] = rng.integers(-1, 2, len(work.held))
    warm = answer(case, softness, work)
    assert cold.code == warm.code == SOLVED
    if set(warm.active) == set(cold.active):
        np.testing.assert_array_equal(warm.x, cold.x)


# --- codes ---------------------------------------------------------------------------


def two(A: Array, lower: Array, upper: Array | None = None) -> Case:
    """Return a QP in the plane with the cost ½ ‖x‖²."""
    upper = np.full(len(A), np.inf) if upper is None else upper
    free = np.full(2, np.inf)
    lower, upper = np.concatenate([lower, -free]), np.concatenate([upper, free])
    return Case(np.eye(2), A, lower, upper, 0, np.zeros(2))


@pytest.mark.parametrize(
    ("A", "lower", "upper"),
    [
        ([[1.0, 0.0]], [1.0], [0.0]),  # lower > upper
        ([[0.0, 0.0]], [1.0], [2.0]),  # a row of zeros
        ([[1.0, 1.0], [2.0, 2.0]], [1.0, -np.inf], [np.inf, 1.0]),  # parallel
    ],
)
def test_contradictions_are_infeasible(
    A: list[list[float]], lower: list[float], upper: list[float]
) -> None:
    case = two(np.array(A), np.array(lower), np.array(upper))
    assert answer(case).code == INFEASIBLE


def test_iterations_are_limited() -> None:
    """With an iteration limit of zero the code reports it."""
    case = degenerate(np.random.default_rng(5))
    assert answer(case).code == SOLVED
    assert answer(case, iterations=0).code == EXHAUSTED


def test_sizes_that_do_not_fit_are_refused() -> None:
    case = two(np.eye(2), np.zeros(2))
    x, work = case.x0.copy(), Workspace.of(2, 2)
    problem = packed(case)._replace(own=np.ones(1))
    with pytest.raises(ValueError, match="a QP: the sizes do not fit together"):
        engine.Minimise(problem=problem, iterations=10, warm=False, x=x, work=work)


def test_active_constraints_span_no_more_than_there_is() -> None:
    """Where active rows span the space, the residual of another one is rounding.

    From contradicting effort limits of a Talos: one row more than the solver's memory.
    """
    with np.load(Path(__file__).parent / "data/full_active_set.npz") as arrays:
        given: Any = {name: arrays[name] for name in arrays.files}
    problem = QP(**given | {"equalities": int(given["equalities"])})
    n, k = len(problem.JT) + len(problem.own), len(problem.A)
    work = Workspace.of(n, k)
    x = np.zeros(n)
    engine.Minimise(problem=problem, iterations=10, warm=False, x=x, work=work)()
    active = work.active[: work.counts[0]]
    assert len(active) == n
    assert len({*active.tolist()}) == n
    assert np.isfinite(x).all()
