"""Which steps a compiled loop may make, and which it leaves to Python."""

import numpy as np
import pytest

from hsp_control.compiled.moves import REFUSED
from hsp_control.control.actuation import Status
from hsp_control.control.actuation.actuation import LOOK
from hsp_control.control.mixture import is_free


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
    assert bool(is_free(value)) is free
