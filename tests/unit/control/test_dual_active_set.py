"""The QP solver: proofs of optima, two other solvers, warm starts, softness, codes."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from places import ROOT
from qp_cases import (
    KINDS,
    Case,
    answer,
    around,
    by_daqp,
    cost,
    defect,
    degenerate,
    dense,
    exact_cost,
    factor,
    residual,
)

from hsp_control.common.arrays import Array
from hsp_control.control.actuation import dual_active_set
from hsp_control.control.actuation.dual_active_set import (
    EXHAUSTED,
    INFEASIBLE,
    SOLVED,
    Workspace,
)

seeds = st.integers(0, 2**32 - 1)
QUICK = 3 if dual_active_set.minimise.__class__.__name__ == "function" else 150
"""QPs of a kind; uncompiled, the kernel takes a hundred times as long."""


# --- optima --------------------------------------------------------------------------


@pytest.mark.parametrize("kind", KINDS)
def test_many_of_each_kind(kind: str) -> None:
    """Solved where there is a solution; each answer proves itself; DAQP agrees."""
    for seed in range(QUICK):
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


@settings(max_examples=20)
@given(seeds)
def test_exact_arithmetic_confirms_it(seed: int) -> None:
    case = dense(np.random.default_rng(seed))
    found = answer(case)
    exact = exact_cost(case, found)
    assert exact is not None
    np.testing.assert_allclose(cost(case, found.x), exact, rtol=1e-9, atol=1e-12)


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


def test_a_repeated_row_does_no_harm() -> None:
    """Forty times the same row, once nearly: one is active."""
    A = np.tile([[1.0, 2.0]], (40, 1))
    A[3] *= 1.0 + 1e-14
    case = two(A, lower=np.full(40, 5.0))
    found = answer(case)
    assert found.code == SOLVED
    np.testing.assert_allclose(found.x, [1.0, 2.0], rtol=1e-12)
    assert len(found.active) == 1


def test_costs_that_differ_by_a_trillion() -> None:
    """A row between cheap and dear motions moves the cheap one."""
    JT = np.diag([1e-3, 1e3])
    case = two(np.array([[1.0, 1.0]]), lower=np.array([1.0]))._replace(JT=JT)
    np.testing.assert_allclose(answer(case).x, [1e-12, 1.0], rtol=1e-11)


# --- warm starts ---------------------------------------------------------------------


@given(st.sampled_from(sorted(set(KINDS) - {"infeasible"})), seeds)
def test_any_warm_start_gives_the_same(kind: str, seed: int) -> None:
    rng = np.random.default_rng(seed)
    case = KINDS[kind](rng)
    cold, work = answer(case), Workspace.of(len(case.x0), len(case.A))
    work.held[:] = rng.integers(-1, 2, len(work.held))
    warm = answer(case, work=work)
    assert warm.code == SOLVED
    if set(warm.active) == set(cold.active):  # the same to the last bit
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


def test_a_warm_start_survives_a_limit_that_disappears() -> None:
    case = two(np.array([[1.0, 0.0]]), lower=np.array([1.0]))
    work = Workspace.of(2, 1)
    np.testing.assert_allclose(answer(case, work=work).x, [1.0, 0.0])
    free = two(np.array([[1.0, 0.0]]), lower=np.array([-np.inf]))
    np.testing.assert_array_equal(answer(free, work=work).x, [0.0, 0.0])


# --- soft constraints ----------------------------------------------------------------


@given(seeds)
def test_a_soft_row_has_its_slack_as_an_unknown(seed: int) -> None:
    """The same as the QP in (x, slack), without constraints on the slack."""
    rng = np.random.default_rng(seed)
    case = KINDS["infeasible" if seed % 2 else "dense"](rng)
    softness = 10.0 ** rng.uniform(-2.0, 1.0, len(case.rows))
    softness[: case.equalities] = 0.0
    found = answer(case, softness)
    wide = widened(case, softness)
    x = by_daqp(wide)
    assert x is not None
    assert found.code == SOLVED
    n = len(case.x0)
    tolerance = 1e-7 * (1.0 + np.abs(x).max())
    np.testing.assert_allclose(found.x, x[:n], rtol=0, atol=tolerance)


@given(seeds)
def test_a_contradiction_is_shared_by_the_costs(seed: int) -> None:
    """x ≥ 1 and x ≤ -1, little softness: violated in proportion to σ²."""
    weight = np.random.default_rng(seed).uniform(0.1, 10.0)
    A = np.array([[1.0, 0.0], [1.0, 0.0]])
    case = two(A, np.array([1.0, -np.inf]), np.array([np.inf, -1.0]))
    assert answer(case).code == INFEASIBLE
    found = answer(case, 1e-4 * np.array([1.0, np.sqrt(weight), 0.0, 0.0]))
    assert found.code == SOLVED
    violations = np.array([1.0 - found.x[0], found.x[0] + 1.0])
    expected = 2.0 * np.array([1.0, weight]) / (1.0 + weight)
    np.testing.assert_allclose(violations, expected, rtol=1e-6)


def test_hard_rows_hold_beside_soft_ones() -> None:
    A = np.array([[1.0, 0.0], [1.0, 0.0]])
    case = two(A, np.array([1.0, -np.inf]), np.array([np.inf, -1.0]))
    found = answer(case, np.array([1e-3, 0.0, 0.0, 0.0]))
    assert found.code == SOLVED
    np.testing.assert_allclose(found.x[0], -1.0, rtol=1e-9)


def widened(case: Case, softness: Array) -> Case:
    """Return the QP in (x, slack); the bounds of x become rows."""
    (nz, n), total = case.JT.shape, len(softness)
    JT = np.zeros((nz + total, n + total))
    JT[:nz, :n] = case.JT
    JT[nz:, n:] = np.diag(np.maximum(softness, 1e-300))
    free = np.full(n + total, np.inf)
    return Case(
        JT,
        np.hstack([case.rows, np.diag(np.where(softness > 0.0, 1.0, 0.0))]),
        np.concatenate([case.lower, -free]),
        np.concatenate([case.upper, free]),
        case.equalities,
        np.concatenate([case.x0, np.zeros(total)]),
    )


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


@pytest.mark.parametrize("name", ["JT", "A", "lower", "upper", "x0"])
def test_nan_is_never_solved(name: str) -> None:
    case = dense(np.random.default_rng(1))
    spoilt = np.array(getattr(case, name))
    spoilt.flat[0] = np.nan
    assert answer(case).code == SOLVED
    assert answer(case._replace(**{name: spoilt})).code == INFEASIBLE


def test_iterations_are_limited(monkeypatch: pytest.MonkeyPatch) -> None:
    """Uncompiled, with a limit of none: the code says so."""
    script = (
        "import numpy as np\n"
        "from hsp_control.control.actuation import dual_active_set as solver\n"
        "from qp_cases import KINDS, answer, defect\n"
        "for kind in KINDS:\n"
        "    case = KINDS[kind](np.random.default_rng(5))\n"
        "    found = answer(case)\n"
        "    assert found.code == (0 if case.feasible else 1), kind\n"
        "    assert not case.feasible or defect(case, found) < 1e-8, kind\n"
        "solver._ITERATIONS = 0\n"
        "case = KINDS['degenerate'](np.random.default_rng(5))\n"
        "print(answer(case).code)\n"
    )
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")
    support = str(Path(ROOT) / "tests" / "support")
    path = os.pathsep.join([support, str(ROOT)])
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.stdout.strip() == str(EXHAUSTED), done.stderr


def test_each_guard_can_fail() -> None:
    """The measures that these tests rest on notice a wrong answer."""
    rng = np.random.default_rng(3)
    case = around(rng, factor(rng, 6, 6), rng.standard_normal((8, 6)))
    found = answer(case)
    assert len(found.active) > 0
    assert defect(case, found._replace(x=found.x + 1e-6)) > 1e-8
    assert defect(case, found._replace(multipliers=-found.multipliers)) > 1e-8
    assert residual(case, found.x + 1.0) > 1e-8
    fewer = found._replace(active=found.active[1:], sides=found.sides[1:])
    assert exact_cost(case, found) is not None
    assert exact_cost(case, fewer) is None
