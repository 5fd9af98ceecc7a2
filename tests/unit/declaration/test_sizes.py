"""Numbers from users are bounded, so that their products do not overflow."""

from typing import Any

import numpy as np
import pytest
from pydantic import TypeAdapter, ValidationError
from wording import wording

import hsp_control as hsp
from hsp_control.common.errors import HspControlError
from hsp_control.declaration import quantities
from hsp_control.declaration.quantities import LARGEST

NUMBERS = [quantities.Number, quantities.Positive, quantities.NonNegative]
ARRAYS = {
    quantities.Vector: [1.0],
    quantities.Vector3: [1.0, 2.0, 3.0],
    quantities.PositiveVector2: [1.0, 2.0],
    quantities.PositiveVector3: [1.0, 2.0, 3.0],
    quantities.Points: [[1.0, 2.0, 3.0]],
    quantities.Grid: [[1.0, 2.0], [3.0, 4.0]],
    quantities.Matrix: [[1.0]],
    quantities.Tensor: [[[1.0]]],
    quantities.Gain: [1.0, 2.0],
    quantities.PositiveNumbers: [1.0, 2.0],
    quantities.Weights: [1.0, 2.0],
}


def with_last(value: Any, number: float) -> Any:
    """Return nested lists whose last number is another one."""
    if not isinstance(value, list):
        return number
    return [*value[:-1], with_last(value[-1], number)]


@pytest.mark.parametrize("kind", [*NUMBERS, *ARRAYS])
def test_huge_numbers_are_refused(kind: Any) -> None:
    adapter, value = TypeAdapter(kind), ARRAYS.get(kind, 1.0)
    adapter.validate_python(with_last(value, LARGEST))
    for huge in (1.01e30, 1e150, 1.7e308):
        with pytest.raises(ValidationError, match="absurdly large; its size must be"):
            adapter.validate_python(with_last(value, huge))
    if kind in (quantities.Number, quantities.Vector3, quantities.Matrix):
        with pytest.raises(ValidationError, match="absurdly large"):
            adapter.validate_python(with_last(value, -1e150))
        adapter.validate_python(with_last(value, 1e-40))  # a rounding


@pytest.mark.parametrize("kind", [quantities.Positive, quantities.PositiveNumbers])
def test_positive_numbers_are_not_nearly_0(kind: Any) -> None:
    TypeAdapter(kind).validate_python(1e-30)
    for tiny in (1e-31, 1e-300, 5e-324):
        with pytest.raises(ValidationError, match="absurdly small; must be 1e-30"):
            TypeAdapter(kind).validate_python(tiny)


@pytest.fixture(scope="module")
def panda() -> hsp.Robot:
    return hsp.Robot.load("panda")


def test_the_largest_that_is_allowed_gives_an_effort(panda: hsp.Robot) -> None:
    """Without a NumPy warning: pytest raises warnings as errors."""
    q, v, gains = panda.home(), np.zeros(7), hsp.Gains(natural_frequency=1e3)
    for target in ([LARGEST, 0.0, 0.0], [-LARGEST, LARGEST, LARGEST]):
        task = hsp.FramePosition("panda_tcp", target, gains=gains)
        field = hsp.TargetPosture(np.full(7, LARGEST))
        tau = hsp.Controller(panda, [task], field).compute(0.0, q, v).tau
        assert np.isfinite(tau).all()


def test_the_message_has_the_place_and_the_right_value(panda: hsp.Robot) -> None:
    reported = wording("Hold: point.1: 1e+150 ... 1e+30")
    with pytest.raises(HspControlError, match=reported):
        hsp.FramePosition("panda_tcp", [0.4, 1e150, 0.4])


def test_a_gain_of_the_null_space_is_not_huge(panda: hsp.Robot) -> None:
    task = hsp.FramePosition("panda_tcp", [0.4, 0.0, 0.4])
    with pytest.raises(HspControlError, match=r"null_space_gain contains 1e\+150"):
        hsp.Controller(panda, [task], null_space_gain=1e150)
