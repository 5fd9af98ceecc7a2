"""Methods that override others take the arguments these are called with."""

from typing import Any

import numpy as np
import pytest

import hsp_control as hsp


def no_arguments(self: Any) -> float:
    return 0.0


def too_many(self: Any, state: hsp.RobotState, time: float) -> float:
    return time


def a_keyword(self: Any, state: hsp.RobotState, *, scale: float) -> float:
    return scale


def as_declared(self: Any, state: hsp.RobotState) -> float:
    return 0.0


def with_defaults(
    self: Any, at: hsp.RobotState, k: float = 1.0, *, j: int = 0
) -> float:
    return k


def any_number(*given: Any) -> float:
    return float(len(given))


def field(value: Any) -> type[hsp.NullSpaceField]:
    """Return a class of fields with this method."""
    return type(hsp.NullSpaceField)("Own", (hsp.NullSpaceField,), {"value": value})


@pytest.mark.parametrize("method", [no_arguments, too_many, a_keyword])
def test_other_arguments_are_refused_where_the_class_is_made(method: Any) -> None:
    with pytest.raises(TypeError) as raised:
        field(method)
    message = str(raised.value)
    assert message.startswith("Own.value(self")
    assert "overrides NullSpaceField.value(self, state: " in message
    assert message.endswith("it must take the same arguments")


@pytest.mark.parametrize("method", [as_declared, with_defaults, any_number])
def test_the_same_arguments_and_optional_ones_are_accepted(method: Any) -> None:
    field(method)


def test_a_method_of_an_own_base_is_checked_too() -> None:
    class Base(hsp.fields.VectorField):
        def own(self, q: Any) -> Any:
            return np.zeros(7)

    with pytest.raises(TypeError, match=r"Twice.own\(self\) -> Any overrides Base.own"):

        class Twice(Base):
            def own(self) -> Any:  # type: ignore[override]
                return np.ones(7)
