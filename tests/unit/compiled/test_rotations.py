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
from hsp_control.compiled import rotations as so3

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


def matrix(kernel: Callable[..., None], *arguments: Array) -> Array:
    out = np.full((3, 3), np.nan)
    kernel(*arguments, out)
    return out


def vector(kernel: Callable[..., None], *arguments: Array) -> Array:
    out = np.full(3, np.nan)
    kernel(*arguments, out)
    return out


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
    np.testing.assert_allclose(matrix(so3.exp3, y), R, rtol=0, atol=1e-15)
    np.testing.assert_allclose(vector(so3.log3, R), pin.log3(R), rtol=0, atol=3e-14)
    np.testing.assert_allclose(matrix(so3.jlog3, y), pin.Jlog3(R), rtol=0, atol=3e-14)
    # Pinocchio's Jexp3 is itself 8e-14 off where its series begins
    np.testing.assert_allclose(matrix(so3.jexp3, y), pin.Jexp3(y), rtol=0, atol=2e-13)


@pytest.mark.parametrize("axis", AXES)
@pytest.mark.parametrize("angle", [*ANGLES, *NEAR_PI])
def test_log_keeps_all_digits_from_0_to_pi(angle: float, axis: Array) -> None:
    y = angle * axis
    found = vector(so3.log3, matrix(so3.exp3, y))
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
        return matrix(so3.jexp3, path(t)) @ (y_dot + t * y_ddot)

    R = matrix(so3.exp3, y)

    def turned(t: float) -> Array:
        return vector(so3.log3, R.T @ matrix(so3.exp3, path(t)))

    np.testing.assert_allclose(body_rate(0.0), slope(turned), rtol=0, atol=1e-10)
    body_acceleration = (
        matrix(so3.jexp3, y) @ y_ddot + matrix(so3.jexp3_dot, y, y_dot) @ y_dot
    )
    np.testing.assert_allclose(body_acceleration, slope(body_rate), rtol=0, atol=1e-10)


@quick
@given(rotation_vectors)
def test_quaternions_agree_with_pinocchio(y: Array) -> None:
    R = matrix(so3.exp3, y)
    quaternion = np.empty(4)
    so3.quaternion_from_rotation(R, quaternion)
    expected = pin.Quaternion(R).coeffs()
    assert quaternion[3] >= 0.0
    assert abs(quaternion @ expected) == pytest.approx(1.0, abs=1e-14)
    for factor in (1.0, -1.0, 0.3):  # neither sign nor length matters
        back = matrix(so3.rotation_from_quaternion, factor * quaternion)
        np.testing.assert_allclose(back, R, rtol=0, atol=2e-15)


@pytest.mark.parametrize("angle", [*ANGLES, *NEAR_PI, 5.0])
def test_uncompiled_equals_compiled(
    angle: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    y, y_dot = angle * AXES[-1], np.array([0.3, -2.0, 0.7])
    R = pin.exp3(y)
    quaternion = pin.Quaternion(R).coeffs()
    calls: list[tuple[str, tuple[Any, ...], tuple[int, ...]]] = [
        ("exp3", (y,), (3, 3)),
        ("jexp3", (y,), (3, 3)),
        ("jexp3_dot", (y, y_dot), (3, 3)),
        ("jlog3", (y,), (3, 3)),
        ("log3", (R,), (3,)),
        ("cross", (y, y_dot), (3,)),
        ("rotate", (R, y_dot), (3,)),
        ("rotate_back", (R, y_dot), (3,)),
        ("compose", (R, R), (3, 3)),
        ("compose_back", (R, R), (3, 3)),
        ("turn", (R, y_dot, 0.3), (3, 3)),
        ("rotation_from_quaternion", (quaternion,), (3, 3)),
        ("quaternion_from_rotation", (R,), (4,)),
    ]

    def results() -> list[Array]:
        found = []
        for name, arguments, shape in calls:
            out = np.full(shape, np.nan)
            getattr(so3, name)(*arguments, out)
            found.append(out)
        return found

    compiled = results()
    for name, member in list(vars(so3).items()):
        if hasattr(member, "py_func"):
            monkeypatch.setattr(so3, name, member.py_func)
    for call, a, b in zip(calls, compiled, results(), strict=True):
        np.testing.assert_allclose(a, b, rtol=0, atol=1e-15, err_msg=call[0])
