"""Kernels that are called by kernels: compiled for these alone, until Python calls."""

import numpy as np
import pytest

from hsp_control.common.arrays import Array
from hsp_control.common.kernels import PLAIN, kernel
from hsp_control.common.native import bind

pytestmark = pytest.mark.skipif(PLAIN, reason="about what Numba compiles")


@kernel
def _halved(x: Array, i: int) -> float:
    return float(0.5 * x[i])


@kernel
def _scaled(x: Array, factor: float) -> None:
    for i in range(x.shape[0]):
        x[i] = factor * _halved(x, i)


@kernel
def _twice(x: Array) -> float:
    _scaled(x, 3.0)
    _scaled(x, 3.0)
    return _halved(x, 0)


def overloads(function: object) -> int:
    return len(function.overloads)  # type: ignore[attr-defined]


def test_only_what_python_calls_is_made_ready_to_run() -> None:
    x = np.array([1.0, -4.0])
    assert bind(_twice, x)() == 0.5 * 2.25
    np.testing.assert_array_equal(x, [2.25, -9.0])
    assert overloads(_halved) == overloads(_scaled) == overloads(_twice) == 0
    _scaled(x, 2.0)
    np.testing.assert_array_equal(x, [2.25, -9.0])
    assert (overloads(_halved), overloads(_scaled)) == (0, 1)


def test_a_mistake_in_one_is_numba_s_error() -> None:
    import numba

    with pytest.raises(numba.TypingError, match="_scaled"):
        bind(_twice, 1.0)()
