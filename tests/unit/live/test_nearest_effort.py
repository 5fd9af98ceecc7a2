"""The nearest effort within rate limits, against an exhaustive search."""

from itertools import product

import numpy as np
import pytest
from live_rigs import PERIOD, start
from loaded_robots import panda

from hsp_control.common.arrays import Array
from hsp_control.live.effort_limiter import EffortLimiter
from hsp_control.live.nearest_effort import nearest_effort
from hsp_control.live.settings import LiveSettings


def exact(wanted: Array, least: Array, most: Array, inertia: Array) -> Array:
    """Return the minimum over all active sets: 3ⁿ."""
    A, best = np.linalg.inv(inertia), (np.inf, wanted)
    for held in product((-1, 0, 1), repeat=wanted.size):
        sides = np.array(held)
        x = np.where(sides < 0, least, most) - wanted
        free = sides == 0
        x[free] = 0.0
        if free.any():
            x[free] = np.linalg.solve(A[np.ix_(free, free)], -(A @ x)[free])
        tau = wanted + x
        if (tau < least - 1e-9).any() or (tau > most + 1e-9).any():
            continue
        best = min(best, (float(x @ A @ x), tau), key=lambda each: each[0])
    return best[1]


@pytest.mark.parametrize("seed", range(20))
def test_it_is_the_exact_minimum(seed: int) -> None:
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(4, 4)) * np.array([3.0, 1.0, 0.5, 0.1])
    inertia = root.T @ root + 0.01 * np.eye(4)
    wanted, center = rng.normal(0.0, 5.0, 4), rng.normal(0.0, 5.0, 4)
    width = rng.uniform(0.1, 5.0, 4)
    found = nearest_effort(wanted, center - width, center + width, inertia)
    assert found is not None
    right = exact(wanted, center - width, center + width, inertia)
    # For nearly parallel axes the sweeps end early: the result is feasible and near.
    A = np.linalg.inv(inertia)
    of = [float((x - wanted) @ A @ (x - wanted)) for x in (found, right)]
    clipped = np.clip(wanted, center - width, center + width)
    start = float((clipped - wanted) @ A @ (clipped - wanted))
    assert of[0] - of[1] <= 1e-3 * (start - of[1]) + 1e-12
    assert (found >= center - width).all()
    assert (found <= center + width).all()


def test_within_the_bounds_it_is_the_desired_effort() -> None:
    wanted, far = np.array([1.0, -2.0]), np.array([np.inf, np.inf])
    found = nearest_effort(wanted, -far, far, np.eye(2))
    np.testing.assert_array_equal(found, wanted)


def test_a_matrix_without_inverse_gives_none() -> None:
    assert (
        nearest_effort(np.ones(2), np.zeros(2), np.zeros(2), np.zeros((2, 2))) is None
    )


def test_a_light_joint_keeps_its_acceleration_where_a_heavy_one_lags() -> None:
    settings = LiveSettings(effort_rate=1000.0)
    limiter = EffortLimiter(panda(), settings, PERIOD)
    limiter.reset(start())
    M = panda().state(0.0, start(), np.zeros(7)).mass_matrix
    wanted = limiter.sent + np.array([0.0, -40.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    rest = np.linalg.solve(M, wanted)
    errors = []
    for inertia in (None, M):
        limiter.reset(start())
        before = limiter.sent.copy()
        assert limiter.apply(wanted, start(), inertia)
        assert (np.abs(limiter.sent - before) <= 1.0 + 1e-12).all()
        errors.append(np.abs(np.linalg.solve(M, limiter.sent) - rest)[4:].max())
    assert errors[1] < 0.5 * errors[0]
