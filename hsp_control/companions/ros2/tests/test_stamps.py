"""States are numbered and dated by stamps with jitter."""

import numpy as np
import pytest

from hsp_control.companions.ros2.stamps import Stamps

PERIOD = 0.002
STEP = 2_000_000
"""The same in ns."""
BEGIN = 1_700_000_000_000_000_000


@pytest.mark.parametrize("jitter", [0.0, 0.1, 0.24])
def test_states_are_numbered_by_how_many_were_sent(jitter: float) -> None:
    """Also with losses: jitter is below half a period."""
    rng = np.random.default_rng(1)
    stamps = Stamps(PERIOD)
    kept = [0, *(1 + np.flatnonzero(rng.uniform(size=400) < 0.7))]
    for k in kept:
        stamp = BEGIN + round(STEP * (k + rng.uniform(-jitter, jitter)))
        assert stamps.take(stamp)
        assert stamps.sequence == k
        assert stamps.last == stamp


@pytest.mark.parametrize(("periods", "states"), [
    (1e-6, 1), (0.3, 1), (0.51, 1), (1.0, 1), (1.49, 1), (1.51, 2), (2.49, 2),
    (2.51, 3), (100.2, 100),
])  # fmt: skip
def test_a_step_is_the_nearest_number_of_periods_and_at_least_one(
    periods: float, states: int
) -> None:
    stamps = Stamps(PERIOD)
    stamps.take(BEGIN)
    assert stamps.take(BEGIN + round(periods * STEP))
    assert stamps.sequence == states


def test_states_with_old_stamps_are_ignored() -> None:
    stamps = Stamps(PERIOD)
    assert stamps.last is None
    assert stamps.t == 0.0
    stamps.begin(3.0)  # before the first state there is no reference
    assert stamps.take(BEGIN)
    assert (stamps.sequence, stamps.t) == (0, 0.0)
    stamps.take(BEGIN + 5 * STEP)
    for stamp in (BEGIN + 5 * STEP, BEGIN + 5 * STEP - 1, BEGIN, 0):
        assert not stamps.take(stamp)
        assert (stamps.sequence, stamps.last) == (5, BEGIN + 5 * STEP)
    assert stamps.take(BEGIN + 6 * STEP)
    assert stamps.sequence == 6


def test_times_are_those_of_the_stamps_from_the_origin_on() -> None:
    """Times include jitter: they date the state, not its number."""
    stamps = Stamps(PERIOD)
    for offset in (0, 900_000, 2_100_000, 4_000_000):
        stamps.take(BEGIN + offset)
        assert stamps.t == pytest.approx(1e-9 * offset, abs=1e-12)
    stamps.begin(0.5)
    assert stamps.t == pytest.approx(0.5)
    stamps.take(BEGIN + 7_000_000)
    assert stamps.t == pytest.approx(0.503, abs=1e-12)
