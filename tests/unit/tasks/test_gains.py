"""Check gains: their three forms, their frequencies, and which are refused."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from hsp_control import Controller, Gains, JointPosture, Robot
from hsp_control.common.exceptions import GainError


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


def test_a_change_leads_both_gains_to_the_new_ones() -> None:
    """Unchanged before it, the mean of both half-way, exactly the new ones after it."""
    robot = Robot.load("planar3r")
    old, new = Gains([4.0, 5.0, 6.0], 7.0), Gains(40.0, [10.0, 20.0, 30.0])
    controller = Controller(robot, [JointPosture("home", gains=old)])
    first, last = old.matrices(3), new.matrices(3)
    half = [0.5 * (a + b) for a, b in zip(first, last, strict=True)]
    controller.at(1.0).ramp(0.5).gains("posture", new)
    for t, expected in ((0.0, first), (1.0, first), (1.25, half), (1.5, last)):
        controller.compute(t, robot.home(), np.zeros(3))
        Kp, Kv, offset, *_ = controller.feedback("posture")
        np.testing.assert_allclose(Kp, expected[0], rtol=1e-14)
        np.testing.assert_allclose(Kv, expected[1], rtol=1e-14)
        assert not offset.any()


GAIN_ERRORS: dict[str, tuple[Callable[[], Any], str]] = {
    "diagonal": (lambda: Gains([[1.0, 0.0], [0.0, -2.0]], 1.0),
     r"^Gains: kp is \[\[1.0, 0.0\], \[0.0, -2.0\]\]; must be greater than 0$"),
    "not square": (lambda: Gains(np.ones((2, 3)), 1.0),
     r"^Gains: kp has shape \(2, 3\); a matrix gain must be square$"),
    "empty": (lambda: Gains([], 1.0), r"^Gains: kp is empty; needs numbers$"),
    "ragged": (lambda: Gains([[1.0], [1.0, 2.0]], 1.0),
     r"^Gains: kp: rows have different lengths \[1, 2\]; need the same$"),
    "none": (lambda: Gains(None, 1.0), r"^Gains: give both kp and kv, or natural_f"),
    "nothing": (lambda: Gains(), r"^Gains: give either kp and kv, or natural_freq"),
    "twice": (lambda: Gains(1.0, 1.0, natural_frequency=1.0),
     r"^Gains: give either kp and kv, or natural_frequency and damping_ratio$"),
    "ratio alone": (lambda: Gains(damping_ratio=1.0),
     r"^Gains: give either kp and kv, or natural_frequency$"),
    "shape of kp": (lambda: Gains([1.0, 2.0], 1.0).matrices(3),
     r"^kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$"),
    "shape of kv": (lambda: Gains(1.0, np.eye(2)).matrices(3),
     r"^kv has shape \(2, 2\); needs a number, 3 numbers or a 3 × 3 matrix$"),
    "no decay": (lambda: Gains([[1.0, 3.0], [3.0, 1.0]], 1.0).matrices(2),
     r"^with these gains the error does not decay: .* real part 1 1/s; needs less"),
    "frequency matrix": (lambda: Gains(natural_frequency=np.eye(2) + 1.0),
     r"^Gains: natural_frequency and damping_ratio must be numbers or lists$"),
    "lists of different length": (
     lambda: Gains(natural_frequency=[1.0, 2.0], damping_ratio=[1.0, 1.0, 1.0]),
     r"^Gains: natural_frequency has 2 entries, damping_ratio 3$"),
}  # fmt: skip


@pytest.mark.parametrize("which", GAIN_ERRORS)
def test_errors_of_gains(which: str) -> None:
    build, message = GAIN_ERRORS[which]
    with pytest.raises(GainError, match=message):
        build()
