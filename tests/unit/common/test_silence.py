"""The silence of another process."""

import pytest

from hsp_control.common.silence import Silence


def test_a_step_that_takes_long_is_no_silence() -> None:
    """This process was stopped itself."""
    silence = Silence(-900.0)
    for k in range(10):
        found = silence.look(900.0 * k, received=False)
        assert found == pytest.approx(0.1 * (k + 1))
    assert silence.look(9000.0, received=True) == 0.0
    assert silence.look(9000.05, received=False) == pytest.approx(0.05)
