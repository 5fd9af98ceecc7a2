"""Which steps a compiled loop may make, and which it leaves to Python."""

from collections.abc import Callable

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.compiled.kernels import PLAIN
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.actuation import LOOK
from hsp_control.robot.motion import REFUSED

if PLAIN:
    pytest.skip("plain Python has no native calls", allow_module_level=True)

from hsp_control.control.mixture import free_step, is_free


@pytest.mark.parametrize(
    ("value", "free"),
    [
        (0.0, True),
        (1.0, True),  # with a bounded inverse
        (REFUSED, False),
        (LOOK, False),  # a limit is violated, or the law is not finite
        (LOOK + Status.LIMITED, False),  # and was solved
        (np.nan, False),
        (np.inf, False),
    ],
)
def test_a_step_is_free_whose_law_is_finite_within_limits(
    value: float, free: bool
) -> None:
    assert is_free(value) is free


def test_what_is_not_native_is_no_free_step() -> None:
    """A call in Python, of those that record what was sent, or within the move."""
    experiment = load_experiment("panda_obstacle")
    controller = experiment.controller
    controller.compute(0.0, experiment.q0, experiment.v0)
    found = []
    controller._while_free(lambda step: len(found) or found.append(step) or 0)
    (step,) = found
    sending: list[Callable[[float], float]] = list(step.sending)
    assert sending
    again = free_step(step.move, step.effort, sending)
    assert again is not None
    assert list(again.sending) == sending
    assert free_step(step.move, step.effort, [*sending, float]) is None
    assert free_step(lambda t, q, v: 0.0, step.effort, sending) is None
