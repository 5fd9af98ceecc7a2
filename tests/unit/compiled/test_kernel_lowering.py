"""The code that is written for kernels does what Python does."""

from typing import NamedTuple

import numpy as np
import pytest

from hsp_control.common.arrays import Array
from hsp_control.compiled.kernels import PLAIN, kernel

pytestmark = pytest.mark.skipif(PLAIN, reason="compiled code is tested")


class Pair(NamedTuple):
    """Two arrays and a number."""

    a: Array
    b: Array
    scale: float


@kernel
def _elements(a: Array, b: Array) -> float:
    """Read and write elements, also from the end and of rows."""
    value = 0.0
    for i in range(a.shape[0]):
        k = -1 - i
        for j in range(a.shape[1]):
            b[i, j] = a[k, j] + 2.0 * a[i, -1]
            value += b[i, j] * (i + 10 * j)
        row = a[i]
        value -= row[-1] ** 2 + row[0]
    return value


@kernel
def _total(part: Array) -> float:
    value = float(part.shape[0])
    for i in range(part.shape[0] - 1, -1, -1):
        for j in range(part.shape[1]):
            value += part[i, j] * (i + 10 * j + 1)
    return value


@kernel
def _parts(a: Array, b: Array) -> float:
    """Sum parts between bounds of any sign; loops count up and down in steps."""
    value = a[0].size + 10.0 * a[1:, 1].size
    for k in range(3):
        value += a[1:, 1][k // 2] + 3.0 * a[-1, :-1][k // 2]
    for step in range(-2, 3, 4):
        for i in range(-9 * step, 9 * step, step):
            value = 3.0 * value % 1048576.0 + _total(a[i:-1]) + _total(a[:i])
            for j in range(9, -10, -3):
                value += _total(a[i:j]) - 2.0 * _total(a[1:, i:j]) * j
    b[1:3] = value
    return value


@kernel
def _swapped(pair: Pair) -> Pair:
    a, b, scale = pair
    return Pair(b, a[1:], scale + 1.0)


@kernel
def _of_records(pair: Pair) -> float:
    """Hand over records, made anew."""
    other = _swapped(pair)
    third = _swapped(other) if other.scale > 2.0 else other
    value = third.scale
    for i in range(third.a.shape[0]):
        value += third.a[i] * (i + 1)
    for i in range(third.b.shape[0]):
        value -= third.b[i] * (i + 2)
    return value


def _plain(function):  # type: ignore[no-untyped-def]
    return getattr(function, "py_func", function)


@pytest.mark.parametrize("layout", ["C", "F", "every second", "reversed"])
def test_elements_lie_where_numpy_has_them(layout: str) -> None:
    """Whole numbers: sums are exact in any order."""
    whole = np.arange(48.0).reshape(6, 8)
    a = {
        "C": np.ascontiguousarray(whole),
        "F": np.asfortranarray(whole),
        "every second": whole[::2, 1::3],
        "reversed": whole[::-1, ::-1],
    }[layout]
    written, expected = np.zeros(a.shape), np.zeros(a.shape)
    for function in (_elements, _parts):
        assert function(a, written) == _plain(function)(a, expected)
        np.testing.assert_array_equal(written, expected)


@pytest.mark.parametrize("scale", [1.0, 2.0])
def test_a_record_that_a_kernel_returns_has_the_values_it_was_made_of(
    scale: float,
) -> None:
    """Its fields are in their order, views of arrays too."""
    pair = Pair(np.array([1.0, 2.0, 4.0]), np.array([8.0, 16.0, 32.0, 64.0]), scale)
    a, b = pair.a, pair.b
    if scale == 1.0:  # once: (b, a[1:])
        expected = 2.0 + b @ [1, 2, 3, 4] - a[1:] @ [2, 3]
    else:  # twice: (a[1:], b[1:])
        expected = 4.0 + a[1:] @ [1, 2] - b[1:] @ [2, 3, 4]
    assert _of_records(pair) == expected
