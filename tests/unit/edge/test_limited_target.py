"""The acceleration that a step approaches at an active limit, against formulas."""

from typing import Any, NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hsp_control.common.arrays import Array
from hsp_control.edge.excess import Permitted, StepLimits, Wanted
from hsp_control.edge.limit_share import LARGE, limit_share
from hsp_control.edge.limited_target import Parts, limited_target
from hsp_control.engine.plans import planned

NV = 4
seeds = st.integers(0, 2**32 - 1)


class Asked(NamedTuple):
    """Commanded accelerations, and limits."""

    wanted: Wanted
    parts: Parts
    limits: StepLimits
    share: Array  # of the damped law


def drawn(seed: int, size: float, bound: float) -> Asked:
    """Return a random request with given sizes of accelerations and bounds."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(NV, NV))
    M = root @ root.T + np.eye(NV)
    a, *parts = size * rng.normal(size=(1 + len(Parts._fields), NV))
    parts[0] = a.copy()
    away = bound * rng.uniform(0.1, 1.0, size=(2, NV))
    permitted = Permitted(*(bound * rng.uniform(0.5, 2.0, size=(2, NV))), 10.0)
    rows, least = rng.normal(size=(2, NV)), -bound * rng.uniform(0.1, 1.0, size=2)
    limits = StepLimits(-away[0], away[1], rows, least, permitted)
    wanted = Wanted(M, a, M @ a + rng.normal(size=NV))
    return Asked(wanted, Parts(*parts), limits, rng.uniform(size=1))


def excess(given: Asked, change: Array) -> float:
    """Return the excess of a + change over its limits, relative to their range."""
    M, a, effort = given.wanted
    a, effort = a + change, effort + M @ change
    lower, upper, rows, least, permitted = given.limits
    beyond = np.maximum(a - upper, lower - a)
    found = [0.0, *(np.abs(effort) / permitted.effort - 1.0)]
    found += list(beyond / permitted.acceleration)
    missing = (least - rows @ change) / np.linalg.norm(rows, axis=1)
    found += list(missing / permitted.acceleration.min())
    return float(max(found))


def times_permitted(given: Asked, x: Array) -> float:
    """Return the ratio of an acceleration to its bound."""
    permitted = given.limits.permitted
    efforts = np.abs(given.wanted.mass_matrix @ x) / permitted.effort
    motions = np.abs(x) / permitted.acceleration
    return float(max(1.0, efforts.max(), motions.max()))


def called(given: Asked) -> Asked:
    """Return the result of the call for a request."""
    wanted = Wanted(*(each.copy() for each in given.wanted))
    limits = given.limits._replace(least=given.limits.least.copy())
    made = given._replace(wanted=wanted, limits=limits)
    planned([limited_target(*made)]).run(0.0)
    return made


@given(seeds, st.floats(0.1, 1e4))
def test_it_is_the_plain_formula(seed: int, size: float) -> None:
    """A share of the step is the damped law's; a factor 1/min(1 + E, r) of a field
    remains."""
    requested = drawn(seed, size, 10.0)
    law, damped, own, own_damped, braking, braking_damped = requested.parts
    exact = 1.0 - requested.share[0]
    to_damped = (1.0 - exact) * (damped - law)
    field = exact * (own + braking) + (1.0 - exact) * (own_damped + braking_damped)
    times = min(1.0 + excess(requested, to_damped), times_permitted(requested, field))
    change = to_damped - (1.0 - 1.0 / times) * field

    found = called(requested)
    scale = 1e-12 * (1.0 + size)  # rounding of some 50 operations
    M, a, effort = requested.wanted
    np.testing.assert_allclose(found.wanted.acceleration, a + change, atol=scale)
    np.testing.assert_allclose(
        found.wanted.effort, effort + M @ change, atol=100.0 * scale
    )
    limits = requested.limits
    least = limits.least - limits.rows @ change
    np.testing.assert_allclose(found.limits.least, least, atol=scale)


@given(seeds)
def test_within_limits_nothing_changes(seed: int) -> None:
    """For any demand of the damped law and of a field."""
    requested = drawn(seed, 1e4, 10.0)
    _, a, effort = requested.wanted
    for each in (a, effort, requested.share):
        each[:] = 0.0
    np.testing.assert_array_equal(called(requested).wanted.acceleration, a)


@given(seeds, st.floats(1e-6, 3.0))
def test_no_more_is_lost_than_is_beyond(seed: int, beyond: float) -> None:
    """A field's demand against tasks loses E/(1 + E) where a exceeds its limit by E.

    A larger loss at the onset of a violation makes the step oscillate about the limit.
    """
    requested = drawn(seed, 1.0, 10.0)
    M, given, _ = requested.wanted
    most = times_permitted(requested, 1e6 * given) / 1e6
    permitted = given / most  # at the limits
    a, field = (1.0 + beyond) * permitted, (5.0 + beyond) * permitted
    zero, far = np.zeros(NV), requested.limits.permitted.acceleration
    opposed = requested._replace(
        wanted=Wanted(M, a, M @ a),
        parts=Parts(a, a, field, field, zero, zero),
        limits=requested.limits._replace(lower=-far, upper=far, least=np.full(2, -1e9)),
    )
    left = called(opposed).wanted.acceleration
    lost = np.linalg.norm(a - left) / np.linalg.norm(field)
    assert lost <= beyond / (1.0 + beyond) * (1.0 + 1e-6) + 1e-12


def test_an_excess_without_end_leaves_finite_numbers() -> None:
    """A joint of range 0 permits no acceleration: a is 0, or entirely beyond."""
    requested = drawn(0, 1.0, 10.0)
    requested.limits.permitted.acceleration[0] = 0.0
    requested.limits.upper[0] = requested.wanted.acceleration[0] - 1.0
    found = called(requested)
    assert np.isfinite(found.wanted.acceleration).all()


# --- the share of the damped law, and the slack --------------------------------------


class Law:
    """The relevant part of a resolved law."""

    def __init__(self, pulls: Array, share: float, *, known: bool = True) -> None:
        self.problem: Any = self
        self.edge: Any = self
        self.pulls, self.share = pulls, np.array([share])
        self.demands_known = known


def shares(asked: Asked, law: Any, own: Array, at_rest: Array) -> list[float]:
    """Return the share by limits, and the slack."""
    call, found = limit_share(asked.wanted, law, own, at_rest, asked.limits)
    planned([call]).run(0.0)
    return [float(each[0]) for each in found]


@given(seeds, st.floats(0.1, 1e4), st.floats(0.0, 1e4))
def test_the_share_is_the_plain_formula(seed: int, size: float, demand: float) -> None:
    """min(E_t/2, r_f, 1); and the slack is r_f in what μ leaves."""
    rng = np.random.default_rng(seed)
    asked, own = drawn(seed, size, 10.0), size * rng.normal(size=NV)
    at_rest, pulls = demand * rng.normal(size=NV), rng.uniform(0.0, 0.2, size=3)
    law, nothing = Law(pulls, rng.uniform()), np.zeros(NV)
    E_t = min(excess(asked, -own), excess(asked, nothing))
    whole = 1e9 * at_rest  # so that the ratio is above 1, the oracle's least
    r_f = times_permitted(asked, whole) / 1e9 if demand > 1e-6 else 0.0
    r_f = max(r_f, float(np.linalg.norm(pulls)))
    strict = (1.0 - min(r_f, 1.0)) * (1.0 - law.share[0])
    expected = [min(E_t / LARGE, r_f, 1.0), 1.0 - strict]
    # some 50 operations round; a demand below 1e-6 has a ratio of 1e-6 at most
    found = shares(asked, law, own, at_rest)
    np.testing.assert_allclose(found, expected, rtol=1e-10, atol=1e-11)


@given(seeds, st.floats(0.1, 1e4))
def test_tasks_of_unknown_demand_yield_to_limits(seed: int, size: float) -> None:
    """What their errors command is not known: as if it were all that is permitted."""
    rng = np.random.default_rng(seed)
    asked, own = drawn(seed, size, 10.0), size * rng.normal(size=NV)
    law, nothing = Law(np.zeros(3), rng.uniform(), known=False), np.zeros(NV)
    E_t = min(excess(asked, -own), excess(asked, nothing))
    found = shares(asked, law, own, nothing)
    np.testing.assert_allclose(found, [min(E_t / LARGE, 1.0), 1.0], rtol=1e-10)


@given(seeds, st.floats(1.0, 1e6))
def test_tasks_that_are_met_keep_the_law_and_their_priority(
    seed: int, size: float
) -> None:
    """Whatever is beyond limits: J'v of a self-motion, or the braking of a joint."""
    asked = drawn(seed, size, 10.0)
    own = np.random.default_rng(seed).normal(size=NV)
    assert shares(asked, Law(np.zeros(3), 0.0), own, np.zeros(NV)) == [0.0, 0.0]
