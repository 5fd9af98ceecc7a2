"""States are published at the configured rate."""

import numpy as np
import pytest

from hsp_control.companions.shared import Rate


@pytest.mark.parametrize("rate", [1.0, 30.0, 100.0, 300.0, 334.0, 400.0, 999.0, 5000.0])
@pytest.mark.parametrize("period", [0.001, 0.002, 0.0007])
def test_the_mean_rate_is_right(rate: float, period: float) -> None:
    due = Rate(rate)
    count = sum(due.due(k * period) for k in range(round(4.0 / period)))
    assert count == pytest.approx(4.0 * min(rate, 1.0 / period), abs=2)


def test_missed_times_are_skipped_and_a_new_run_begins() -> None:
    due = Rate(100.0)
    times = [0.0, 0.005, 0.5, 0.501, 0.502, 0.51, 0.0, 0.001, 0.01]
    reported = [t for t in times if due.due(t)]
    np.testing.assert_array_equal(reported, [0.0, 0.5, 0.51, 0.0, 0.01])
