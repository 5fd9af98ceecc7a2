"""Saturation of levels by limits, against plain formulas."""

from typing import Any, NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from loaded_robots import load

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.control.actuation.deviation_cost import (
    Directions,
    Levels,
    write_directions,
    write_inverse_root,
)
from hsp_control.edge.excess import Permitted, StepLimits, Wanted
from hsp_control.edge.held_levels import STIFFEST, held_levels
from hsp_control.edge.step import ByLevels, Factors, Projectors
from hsp_control.engine.plans import planned
from hsp_control.law import CONSTANT, IDENTITY

NV, ENDS = 5, (1, 3)
seeds = st.integers(0, 2**32 - 1)


class Law(NamedTuple):
    """The relevant part of a resolved law."""

    problem: Any
    acceleration: Array
    form: int
    ends: Array
    thresholds: Array
    units: Array


class Metric(NamedTuple):
    """Stands for a metric: its factor."""

    L: Array


class Problem(NamedTuple):
    """Stands for a problem: its metric."""

    metric: Metric


def drawn(seed: int, size: float, L: Array | None = None) -> dict[str, Any]:
    """Return a random request of given size, with limits of about 10."""
    rng = np.random.default_rng(seed)
    root, other = rng.normal(size=(2, NV, NV))
    M, W = root @ root.T + np.eye(NV), other @ other.T + 0.1 * np.eye(NV)
    L = np.linalg.cholesky(W) if L is None else L
    law, more = size * rng.normal(size=(2, NV))
    a, away = law + 0.1 * more, 10.0 * rng.uniform(0.1, 1.0, size=(2, NV))
    B = np.linalg.solve(L, rng.normal(size=(NV, ENDS[-1]))).T
    triangle: Array = np.linalg.inv(np.linalg.cholesky(B @ B.T)).astype(np.float64)
    thresholds = rng.uniform(0.1, 3.0, size=len(ENDS))
    ends = np.array(ENDS)
    return {
        "wanted": Wanted(M, a, M @ a + rng.normal(size=NV)),
        "v": 0.1 * size * rng.normal(size=NV),
        "law": Law(
            Problem(Metric(L)),
            law,
            CONSTANT,
            ends,
            thresholds,
            rng.uniform(1.0, 3.0, size=ENDS[-1]),
        ),
        "parts": ByLevels(
            *(size * rng.normal(size=(2, len(ENDS), NV))),
            Factors(triangle @ B, triangle),
        ),
        "slack": rng.choice([np.zeros(1), rng.uniform(size=1), np.ones(1)]),
        "limits": StepLimits(
            -away[0],
            away[1],
            permitted=Permitted(*(10.0 * rng.uniform(0.5, 2.0, size=(2, NV))), 10.0),
            rows=rng.normal(size=(2, NV)),
            least=-rng.uniform(1.0, 10.0, size=2),
        ),
    }


def at_rest(given: dict[str, Any], k: int) -> Array:
    """Return how far the errors of the first levels alone command beyond each limit.

    In an equilibrium no limit of motion is negative.
    """
    at_rest, limits = given["parts"].at_rest[k], given["limits"]
    M, a, effort = given["wanted"]
    pushed = np.abs(effort + M @ (at_rest - a)) - limits.permitted.effort
    missing = -limits.rows @ at_rest
    return np.concatenate([at_rest, -at_rest, pushed, pushed, missing])


def braked(given: dict[str, Any]) -> Array:
    """Return how much each limit demands of a motion, 2 α c v; an effort's anything."""
    v, limits = given["v"], given["limits"]
    rates = np.abs([*v, *v, *np.full(2 * NV, np.inf), *(limits.rows @ v)])
    return 2.0 * limits.permitted.bandwidth * rates


def excesses(given: dict[str, Any], change: Array) -> Array:
    """Return how far a + change is beyond each limit."""
    M, a, effort = given["wanted"]
    a, effort = a + change, effort + M @ change
    lower, upper, rows, least, permitted = given["limits"]
    most, missing = permitted.effort, least - rows @ change
    return np.concatenate(
        [a - upper, lower - a, effort - most, -effort - most, missing]
    )


def costs(given: dict[str, Any]) -> list[float]:
    """Return the largest A/K - n² of each level, by the formula of docs/edge.md."""
    law = given["law"]
    L_inverse = np.linalg.inv(law.problem.metric.L)
    joint = np.linalg.norm(L_inverse, axis=0).max()
    E, M = np.eye(NV), given["wanted"].mass_matrix
    rows = np.vstack([E, E, M, M, given["limits"].rows]) @ L_inverse.T
    length = np.linalg.norm(rows, axis=1)
    Q, X = given["parts"].factors
    parts, slack = (rows @ Q.T / length[:, None]) ** 2, given["slack"][0]
    # the part of each row that higher levels leave
    left = 1.0 / (np.diag(X) * law.units)
    found, start, of_level = [], 0, np.zeros(len(left))
    for k, end in enumerate(ENDS):
        s = np.minimum(left[start:end] / law.thresholds[k], 1.0)
        of_level[start:end] = 1.0 - slack * (1.0 - s**2) ** 2
        own = excesses(given, given["parts"].by_levels[k] - law.acceleration)
        x = np.minimum(own, excesses(given, np.zeros(NV)))
        beyond_rest = np.maximum(x - np.maximum(at_rest(given, k), 0.0), 0.0)
        of_motion = np.minimum(beyond_rest, braked(given))
        x = np.where(x > 0.0, x - (1.0 - slack) * of_motion, 0.0)
        n_square = 1.0 - parts[:, :end] @ of_level[:end]
        cost = joint * x / length / 1000.0 - n_square
        found.append(max(0.0, *cost[x > 0.0], 0.0))
        start = end
    return found


@given(seeds, st.floats(10.0, 1e6))
def test_it_is_the_plain_formula(seed: int, size: float) -> None:
    """Levels' accelerations beyond a limit, less the share that lower ones can absorb.

    Without slack it is what no motion accounts for: what persists of them.
    """
    requested = drawn(seed, size)
    call, held = held_levels(**requested)
    planned([call]).run(0.0)
    np.testing.assert_allclose(held, costs(requested), rtol=1e-9, atol=1e-12 * size)


@given(seeds)
def test_the_identity_is_a_metric_as_others(seed: int) -> None:
    """The identity metric as a constant and as a matrix give the same."""
    found = []
    for form in (IDENTITY, CONSTANT):
        requested = drawn(seed, 1e5, np.eye(NV))
        requested["law"] = requested["law"]._replace(form=form)
        call, held = held_levels(**requested)
        planned([call]).run(0.0)
        found.append(held)
    np.testing.assert_allclose(found[0], found[1], rtol=1e-12)


@pytest.mark.parametrize("far", [False, True])
@pytest.mark.parametrize("metric", ["identity", "mass"])
@given(seeds)
@settings(max_examples=10, deadline=None)
def test_the_demand_of_a_level_does_not_depend_on_lower_ones(
    metric: str, far: bool, seed: int
) -> None:
    """The first level's part of a is the law of a controller without the others.

    With a target out of reach it is the damped law's.
    """
    robot, rng = load("panda"), np.random.default_rng(seed)
    q, v = robot.home() + 0.3 * rng.standard_normal(7), 0.3 * rng.standard_normal(7)
    here = robot.state(0.0, q, v).position("panda_tcp")
    goal = here + (2.0 if far else 0.02) * rng.standard_normal(3)
    error: Any = "robot" if far else "none"  # does not bound the inverse
    tasks = [
        hsp.FramePosition("panda_tcp", hsp.Hold(goal), largest_error=error),
        hsp.FrameOrientation("panda_tcp", priority=2, largest_error=error),
    ]
    found = []
    for count in (1, 2):
        weight = hsp.metrics.MassMatrixMetric() if metric == "mass" else None
        made = hsp.Controller(robot, tasks[:count], metric=weight, start=robot.home())
        made.compute(0.0, q, v)
        law = made._active.law
        assert far or law.edge_level[0] == 0
        calls = [law.call(v, beside=True), law.self_motions(v)[0]]
        parted, (by_levels, *_) = law.by_levels(v)
        planned([*calls, parted]).run(0.0)
        found.append(by_levels[0].copy())
        if count == 1 and far and law.edge_level[0]:
            found[0] = law.edge.damped - law.self_motions(v)[1][0][1]
    np.testing.assert_allclose(found[1], found[0], rtol=1e-7, atol=1e-7)


@given(st.floats(0.0, 2.0 * np.pi), st.floats(-3.0, 5.0), st.floats(0.0, 1.0))
def test_a_deviation_rotates_slowly_enough_for_a_period(
    angle: float, exponent: float, share: float
) -> None:
    """A task along one direction of a plane moves one joint x beyond its limit.

    The nearest step, δ = H⁻¹c x/(cᵀH⁻¹c), turns with the direction by K at most for
    each radian, for any x; with a cost of 1e-6 it would turn by 1e6 x.
    """
    x = 10.0**exponent

    def deviation(angle: float) -> Array:
        row = np.array([[np.cos(angle), np.sin(angle)]])
        factors, ends, epsilon = (
            Factors(row, np.eye(1)),
            np.array([1]),
            np.full(1, 1e-3),
        )
        metric, nothing = Problem(Metric(np.eye(2))), np.zeros(2)
        parts = ByLevels(np.zeros((1, 2)), np.array([[x, 0.0]]), factors)
        slack = np.array([share])
        law: Any = Law(metric, nothing, IDENTITY, ends, epsilon, np.ones(1))
        holding, held = held_levels(
            Wanted(np.eye(2), nothing, nothing), nothing, law, parts, slack,
            StepLimits(
                np.full(2, -np.inf), np.array([-x, np.inf]), np.zeros((0, 2)),
                np.zeros(0), Permitted(*np.full((2, 2), np.inf), 10.0),
            ),
        )  # fmt: skip
        directions = Directions.of(2)
        levels = Levels(
            jacobian=row, L=np.eye(2), form=IDENTITY, ends=ends,
            error=np.zeros(1), springs=np.zeros(1, dtype=np.bool_), size=1.0,
            first=0, least=1e-6, held=held,
            thresholds=epsilon, units=law.units, factors=factors, exact=factors,
            slack=slack,
            projectors=Projectors.allocate(1, 2),
            edge_level=np.zeros(1, dtype=np.int64), alone=True,
        )  # fmt: skip
        JT, moving = np.zeros((2, 2)), np.zeros(1, dtype=np.int64)
        written = write_directions(levels, directions)
        root = write_inverse_root(levels, directions, False, JT, moving)
        planned([holding, written, root]).run(0.0)
        inverse = JT.T @ JT
        return np.asarray(inverse[0] * x / inverse[0, 0])

    h = 1e-6
    turned = (deviation(angle + h) - deviation(angle - h)) / (2.0 * h)
    # 1e-3 for the difference's own error; rounding makes 1e-10 of x.
    assert np.linalg.norm(turned) <= STIFFEST * (1.0 + 1e-3) + 1e-9 * x
