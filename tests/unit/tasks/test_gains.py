"""Check gains: their three forms, their frequencies, and which are refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from hsp_control import (
    Gains,
    JointPosture,
    Robot,
)
from hsp_control.common.exceptions import (
    GainError,
)
from hsp_control.tasks.gain_ramp import GainRamp

pytestmark = pytest.mark.filterwarnings("error")


def test_gains_in_three_forms() -> None:
    for kp, kv in (
        (4.0, 5.0),
        ([4.0, 4.0], [5.0, 5.0]),
        (4 * np.eye(2), 5 * np.eye(2)),
    ):
        Kp, Kv = Gains(kp, kv).matrices(2)
        np.testing.assert_array_equal(Kp, 4.0 * np.eye(2))
        np.testing.assert_array_equal(Kv, 5.0 * np.eye(2))
    Kp, Kv = Gains([1.0, 2.0], [[3.0, 0.5], [0.1, 4.0]]).matrices(2)
    np.testing.assert_array_equal(Kp, np.diag([1.0, 2.0]))
    np.testing.assert_array_equal(Kv, [[3.0, 0.5], [0.1, 4.0]])


def test_a_ramp_leads_both_gains_to_the_new_ones() -> None:
    """Unchanged before it, the mean of both half-way, exactly the new ones after it."""
    robot = Robot.load("planar3r")
    old, new = Gains([4.0, 5.0, 6.0], 7.0), Gains(40.0, [10.0, 20.0, 30.0])
    task = JointPosture(robot.neutral(), gains=old)
    first, last = old.matrices(3), new.matrices(3)
    half = [0.5 * (a + b) for a, b in zip(first, last, strict=True)]
    ramp = GainRamp(task, new, start=1.0, ramp=0.5)
    for t, expected in ((0.0, first), (1.0, first), (1.25, half), (1.5, last)):
        assert ramp.apply(t) is (t == 1.5)
        np.testing.assert_allclose(task.Kp, expected[0], rtol=1e-14)
        np.testing.assert_allclose(task.Kv, expected[1], rtol=1e-14)


def test_matrices_are_copies() -> None:
    gains = Gains(np.eye(2), np.eye(2))
    gains.matrices(2)[0][:] = 7.0
    np.testing.assert_array_equal(gains.matrices(2)[0], np.eye(2))


def test_repr_of_gains_can_be_read_back() -> None:
    gains = Gains([1.0, 2.0], 3.0)
    assert repr(gains) == "Gains(kp=[1.0, 2.0], kv=3.0)"
    assert repr(eval(repr(gains))) == repr(gains)


positive = st.floats(1e-3, 1e3)


@settings(max_examples=100, deadline=None, derandomize=True)
@given(positive, st.floats(0.05, 5.0))
def test_gains_from_frequency(frequency: float, ratio: float) -> None:
    """s² + Kv s + Kp has |s| = ω0, and real parts of -ζ ω0 in the mean."""
    Kp, Kv = Gains(natural_frequency=frequency, damping_ratio=ratio).matrices(1)
    roots = np.roots([1.0, Kv[0, 0], Kp[0, 0]])
    assert np.prod(roots).real == pytest.approx(frequency**2, rel=1e-9)
    assert np.sum(roots).real == pytest.approx(-2.0 * ratio * frequency, rel=1e-9)


def test_gains_from_frequency_defaults_and_lists() -> None:
    assert repr(Gains(natural_frequency=3.0)) == "Gains(kp=9.0, kv=6.0)"
    Kp, Kv = Gains(natural_frequency=[2.0, 3.0], damping_ratio=[1.0, 0.5]).matrices(2)
    np.testing.assert_array_equal(Kp, np.diag([4.0, 9.0]))
    np.testing.assert_array_equal(Kv, np.diag([4.0, 3.0]))


GAIN_ERRORS: dict[str, tuple[Callable[[], Any], str]] = {
    "negative": (lambda: Gains(-1.0, 1.0), r"^kp is -1.0; must be greater than 0$"),
    "zero": (lambda: Gains(1.0, [1.0, 0.0]), r"^kv is \[1.0, 0.0\]; must be greater"),
    "diagonal": (
        lambda: Gains([[1.0, 0.0], [0.0, -2.0]], 1.0),
        r"^kp is \[\[1.0, 0.0\], \[0.0, -2.0\]\]; must be greater than 0$",
    ),
    "nan": (lambda: Gains(np.nan, 1.0), r"^kp is nan; needs finite numbers$"),
    "infinite": (lambda: Gains(1.0, np.inf), r"^kv is inf; needs finite numbers$"),
    "not square": (
        lambda: Gains(np.ones((2, 3)), 1.0),
        r"^kp has shape \(2, 3\); a matrix gain must be square$",
    ),
    "three axes": (
        lambda: Gains(np.ones((1, 1, 1)), 1.0),
        r"^kp has shape \(1, 1, 1\)",
    ),
    "empty": (lambda: Gains([], 1.0), r"^kp is empty; needs numbers$"),
    "words": (
        lambda: Gains("stiff", 1.0),
        r"^kp is 'stiff'; needs numbers, a list or a matrix$",
    ),
    "ragged": (lambda: Gains([[1.0], [1.0, 2.0]], 1.0), r"needs numbers, a list or a"),
    "none": (lambda: Gains(None, 1.0), r"^kp is (nan|None); needs"),
    "shape of kp": (
        lambda: Gains([1.0, 2.0], 1.0).matrices(3),
        r"^kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
    "shape of kv": (
        lambda: Gains(1.0, np.eye(2)).matrices(3),
        r"^kv has shape \(2, 2\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
    "no decay": (
        lambda: Gains([[1.0, 3.0], [3.0, 1.0]], 1.0).matrices(2),
        r"^with these gains the error does not decay: .* real part 1 1/s; needs less",
    ),
    "frequency": (
        lambda: Gains(natural_frequency=0.0),
        r"^natural_frequency is 0.0; must be greater than 0$",
    ),
    "ratio": (
        lambda: Gains(natural_frequency=1.0, damping_ratio=-1.0),
        r"^damping_ratio is -1.0; must be greater than 0$",
    ),
    "frequency matrix": (
        lambda: Gains(natural_frequency=np.eye(2) + 1.0),
        r"^natural_frequency and damping_ratio must be numbers or lists$",
    ),
    "lists of different length": (
        lambda: Gains(natural_frequency=[1.0, 2.0], damping_ratio=[1.0, 1.0, 1.0]),
        r"^natural_frequency and damping_ratio: ",
    ),
}


@pytest.mark.parametrize("which", GAIN_ERRORS)
def test_errors_of_gains(which: str) -> None:
    build, message = GAIN_ERRORS[which]
    with pytest.raises(GainError, match=message):
        build()
