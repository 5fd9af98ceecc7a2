"""The acceleration that a step approaches at an active limit, against formulas."""

from typing import NamedTuple

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from hsp_control.common.arrays import Array
from hsp_control.edge.limited_target import (
    LARGE,
    Barred,
    Parts,
    Permitted,
    Within,
    limited_target,
)
from hsp_control.engine.plans import planned

NV = 4
seeds = st.integers(0, 2**32 - 1)


class Asked(NamedTuple):
    """Commanded accelerations, and the bounds of limits."""

    M: Array
    a: Array
    effort: Array
    parts: Parts
    bounds: Within
    permitted: Permitted
    barred: Barred


def drawn(seed: int, size: float, bound: float) -> Asked:
    """Return a random request with given sizes of accelerations and bounds."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(NV, NV))
    M = root @ root.T + np.eye(NV)
    a, *parts = size * rng.normal(size=(1 + len(Parts._fields), NV))
    parts[0] = a.copy()
    away = bound * rng.uniform(0.1, 1.0, size=(2, NV))
    permitted = Permitted(*(bound * rng.uniform(0.5, 2.0, size=(2, NV))))
    rows = Barred(rng.normal(size=(2, NV)), -bound * rng.uniform(0.1, 1.0, size=2))
    return Asked(
        M, a, M @ a + rng.normal(size=NV), Parts(*parts), Within(-away[0], away[1]),
        permitted, rows,
    )  # fmt: skip


def excess(given: Asked, change: Array) -> float:
    """Return the excess of a + change over its limits, relative to their range."""
    a, effort = given.a + change, given.effort + given.M @ change
    beyond = np.maximum(a - given.bounds.upper, given.bounds.lower - a)
    found = [0.0, *(np.abs(effort) / given.permitted.effort - 1.0)]
    found += list(beyond / given.permitted.acceleration)
    missing = given.barred.lower - given.barred.A @ change
    length = np.linalg.norm(given.barred.A, axis=1)
    found += list(missing / length / given.permitted.acceleration.min())
    return float(max(found))


def times_permitted(given: Asked, x: Array) -> float:
    """Return the ratio of an acceleration to its bound."""
    efforts = np.abs(given.M @ x) / given.permitted.effort
    motions = np.abs(x) / given.permitted.acceleration
    return float(max(1.0, efforts.max(), motions.max()))


def called(given: Asked) -> Asked:
    """Return the result of the call for a request."""
    a, effort, lower = given.a.copy(), given.effort.copy(), given.barred.lower.copy()
    made = given._replace(a=a, effort=effort, barred=Barred(given.barred.A, lower))
    planned([limited_target(*made)]).run(0.0)
    return made


@given(seeds, st.floats(0.1, 1e4))
def test_it_is_the_plain_formula(seed: int, size: float) -> None:
    """E_t/2 of the step is the damped law's; a factor 1/min(1 + E, r) of a field
    remains."""
    requested = drawn(seed, size, 10.0)
    law, damped, own, own_damped, braking, braking_damped = requested.parts
    beyond = min(excess(requested, -own), excess(requested, np.zeros(NV)))
    exact = 1.0 - min(beyond / LARGE, 1.0)
    to_damped = (1.0 - exact) * (damped - law)
    field = exact * (own + braking) + (1.0 - exact) * (own_damped + braking_damped)
    times = min(1.0 + excess(requested, to_damped), times_permitted(requested, field))
    change = to_damped - (1.0 - 1.0 / times) * field

    found = called(requested)
    scale = 1e-12 * (1.0 + size)  # rounding of some 50 operations
    np.testing.assert_allclose(found.a, requested.a + change, atol=scale)
    np.testing.assert_allclose(
        found.effort, requested.effort + requested.M @ change, atol=100.0 * scale
    )
    np.testing.assert_allclose(
        found.barred.lower,
        requested.barred.lower - requested.barred.A @ change,
        atol=scale,
    )


@given(seeds)
def test_within_limits_nothing_changes(seed: int) -> None:
    """For any demand of the damped law and of a field."""
    requested = drawn(seed, 1e4, 10.0)
    requested.a[:] = 0.0
    requested.effort[:] = 0.0
    np.testing.assert_array_equal(called(requested).a, requested.a)


@given(seeds, st.floats(1e-6, 3.0))
def test_no_more_is_lost_than_is_beyond(seed: int, beyond: float) -> None:
    """A field's demand against tasks loses E/(1 + E) where a exceeds its limit by E.

    A larger loss at the onset of a violation makes the step oscillate about the limit.
    """
    requested = drawn(seed, 1.0, 10.0)
    most = times_permitted(requested, 1e6 * requested.a) / 1e6
    permitted = requested.a / most  # at the limits
    a, field = (1.0 + beyond) * permitted, (5.0 + beyond) * permitted
    zero = np.zeros(NV)
    opposed = requested._replace(
        a=a,
        effort=requested.M @ a,
        parts=Parts(a, a, field, field, zero, zero),
        bounds=Within(
            -requested.permitted.acceleration, requested.permitted.acceleration
        ),
        barred=Barred(requested.barred.A, np.full(2, -1e9)),
    )
    lost = np.linalg.norm(a - called(opposed).a) / np.linalg.norm(field)
    assert lost <= beyond / (1.0 + beyond) * (1.0 + 1e-6) + 1e-12


def test_an_excess_without_end_leaves_finite_numbers() -> None:
    """A joint of range 0 permits no acceleration: a is 0, or entirely beyond."""
    requested = drawn(0, 1.0, 10.0)
    requested.permitted.acceleration[0] = 0.0
    requested.bounds.upper[0] = requested.a[0] - 1.0
    found = called(requested)
    assert np.isfinite(found.a).all()
