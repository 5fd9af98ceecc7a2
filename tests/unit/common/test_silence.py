"""How long another process has been silent."""

import pytest

from hsp_control.common.silence import Silence


def test_a_long_step_is_no_silence() -> None:
    """Time in which this process itself was stopped is no silence of the other."""
    silence = Silence(-900.0)
    for k in range(10):
        found = silence.look(900.0 * k, received=False)
        assert found == pytest.approx(0.1 * (k + 1))
    assert silence.look(9000.0, received=True) == 0.0
    assert silence.look(9000.05, received=False) == pytest.approx(0.05)
