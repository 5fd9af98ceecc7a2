"""SO(3) in coordinates: against Pinocchio, exact series, differences and axioms."""

from collections.abc import Callable
from fractions import Fraction
from math import factorial, pi
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsp_control.common.arrays import Array
from hsp_control.engine import rotations as so3

ANGLES = (0.0, 1e-300, 1e-160, 1e-12, 1e-8, 1e-4, 0.1, 1.0, 2.0, 3.0, pi - 1e-4)
NEAR_PI = (pi - 1e-7, pi - 1e-8, pi - 1e-12, pi - 1e-15, pi)
AXES = np.array(
    [[1, 0, 0], [0, -1, 0], [0, 0, 1], [1, 1, 0], [1, -1, 1], [-0.3, 0.2, 0.9]],
    dtype=float,
)
AXES /= np.linalg.norm(AXES, axis=1, keepdims=True)

numbers = st.floats(-1.0, 1.0)
axes = (
    st.tuples(numbers, numbers, numbers)
    .map(np.array)
    .filter(lambda a: np.linalg.norm(a) > 1e-3)
    .map(lambda a: a / np.linalg.norm(a))
)
small = st.floats(0.0, 16.0).map(lambda k: 10.0**-k)
angles = st.one_of(st.floats(0.0, pi), small, small.map(lambda x: pi - x))
rotation_vectors = st.builds(lambda axis, angle: angle * axis, axes, angles)
quick = settings(max_examples=150, deadline=None, derandomize=True)


def slope(function: Callable[[float], Array], h: float = 1e-3) -> Array:
    """Return f'(0) by five points."""
    f = function
    return (f(-2 * h) - 8 * f(-h) + 8 * f(h) - f(2 * h)) / (12 * h)


@pytest.mark.parametrize("s", [0.0, 1e-30, 1e-8, 0.3, 1.0, 4.0, 9.8, 10.0, 20.0, 35.0])
def test_stumpff_functions_equal_their_series(s: float) -> None:
    for k, value in enumerate(so3.stumpff(s)):
        exact = sum((-Fraction(s)) ** j / factorial(k + 2 * j) for j in range(50))
        assert value == pytest.approx(float(exact), rel=0, abs=2e-15)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", ANGLES)
def test_all_agree_with_pinocchio(angle: float, axis: Array) -> None:
    y = angle * axis
    R = pin.exp3(y)
    np.testing.assert_allclose(so3.exp3(y), R, rtol=0, atol=1e-15)
    np.testing.assert_allclose(so3.log3(R), pin.log3(R), rtol=0, atol=3e-14)
    np.testing.assert_allclose(so3.jlog3(y), pin.Jlog3(R), rtol=0, atol=3e-14)
    # Pinocchio's Jexp3 is itself 8e-14 off where its series begins
    np.testing.assert_allclose(so3.jexp3(y), pin.Jexp3(y), rtol=0, atol=2e-13)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [*ANGLES, *NEAR_PI])
def test_log_keeps_all_digits_from_0_to_pi(angle: float, axis: Array) -> None:
    y = angle * axis
    found = so3.log3(so3.exp3(y))
    if found @ y < 0.0:  # at π either sign is right
        assert angle > pi - 1e-12
        found = -found
    np.testing.assert_allclose(found, y, rtol=1e-15, atol=min(angle, 1.0) * 2e-15)


@quick
@given(rotation_vectors, axes, axes)
def test_jacobians_against_differences(y: Array, y_dot: Array, y_ddot: Array) -> None:
    """ω = Jexp y' and ω' = Jexp y'' + Jexp' y' along y + y' t + y'' t²/2."""

    def path(t: float) -> Array:
        return y + t * y_dot + 0.5 * t * t * y_ddot

    def body_rate(t: float) -> Array:
        return so3.jexp3(path(t)) @ (y_dot + t * y_ddot)

    R = so3.exp3(y)

    def turned(t: float) -> Array:
        return so3.log3(R.T @ so3.exp3(path(t)))

    np.testing.assert_allclose(body_rate(0.0), slope(turned), rtol=0, atol=1e-10)
    body_acceleration = so3.jexp3(y) @ y_ddot + so3.jexp3_dot(y, y_dot) @ y_dot
    np.testing.assert_allclose(body_acceleration, slope(body_rate), rtol=0, atol=1e-10)


@quick
@given(rotation_vectors)
def test_quaternions_agree_with_pinocchio(y: Array) -> None:
    R = so3.exp3(y)
    quaternion = so3.quaternion_from_rotation(R)
    expected = pin.Quaternion(R).coeffs()
    assert quaternion[3] >= 0.0
    assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-14)
    for factor in (1.0, -1.0, 0.3):  # neither sign nor length matters
        back = so3.rotation_from_quaternion(factor * quaternion)
        np.testing.assert_allclose(back, R, rtol=0, atol=2e-15)


@pytest.mark.parametrize("wrong", [np.zeros(4), np.eye(2), None])
def test_other_shapes_raise(wrong: Any) -> None:
    for function in (so3.exp3, so3.log3, so3.jlog3):
        with pytest.raises(TypeError, match="incompatible function arguments"):
            function(wrong)


@pytest.mark.parametrize("lay_out", [np.ascontiguousarray, np.asfortranarray])
def test_the_layout_of_a_matrix_does_not_matter(
    lay_out: Callable[[Array], Array],
) -> None:
    y = np.array([0.3, -1.2, 0.7])
    given = lay_out(pin.exp3(y))
    np.testing.assert_allclose(so3.log3(given), y, rtol=0, atol=1e-15)
    expected = pin.Quaternion(given).coeffs()
    found = so3.quaternion_from_rotation(given)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-15)


def test_results_lie_as_calls_of_the_engine_read_them() -> None:
    y = np.array([0.3, -1.2, 0.7])
    for matrix in (so3.exp3(y), so3.jexp3(y), so3.jexp3_dot(y, y), so3.jlog3(y)):
        assert matrix.flags.c_contiguous
        assert matrix.flags.writeable
