"""Plans of parts' calls: arguments by name, and the calls that write them."""

import numpy as np
import pytest

from hsp_control import engine
from hsp_control.common.arrays import Array
from hsp_control.engine.plans import TIME, CallOutput, PartCall, PartCalls, planned
from hsp_control.trajectories import TrajectorySample, UniformLine


def add(x: Array, y: Array, out: Array) -> None:
    """Write x + y."""
    out[:] = x + y


def test_arguments_are_added_by_name_and_none_twice() -> None:
    x, y = np.zeros((2, 3))
    call = PartCall(engine.Copy, x=x)
    given = call.given(out=y)
    assert call.arguments == {"x": x}
    assert given.arguments == {"x": x, "out": y}
    assert repr(given) == "PartCall(Copy, x, out)"
    assert repr(PartCall(add, x=x)).startswith("PartCall(<function add")
    with pytest.raises(TypeError, match="multiple values for keyword argument 'x'"):
        call.given(x=y)


def test_a_function_is_given_its_arguments_by_name_and_the_time_first() -> None:
    reported: list[tuple[float, str]] = []

    def follow(t: float, name: str) -> None:
        reported.append((t, name))

    x, out = np.ones(2), np.zeros(2)
    plan = planned(
        [PartCall(follow, name="a", t=TIME), PartCall(add, out=out, y=2.0 * x, x=x)]
    )
    assert [len(plan.follow), len(plan.write)] == [1, 1]
    plan.run(0.5)
    assert reported == [(0.5, "a")]
    np.testing.assert_array_equal(out, 3.0)


def junk() -> Array:
    """Return an output that must be written."""
    return np.full(2, np.nan)


class Motion:
    """A velocity that a call brings up to date."""

    def __init__(self) -> None:
        self.source, self.value = np.array([0.5, -1.0]), np.zeros(2)

    def supplied(self) -> tuple[Array, PartCalls]:
        """Return the array and the call."""
        return self.value, [PartCall(engine.Copy, x=self.source, out=self.value)]


def test_calls_that_write_arguments_come_first_also_for_groups() -> None:
    offset, doubled = (
        Motion(),
        CallOutput(PartCall(add, x=Motion(), y=Motion()), junk()),
    )
    feedback = {"Kp": np.eye(2), "Kv": np.zeros((2, 2)), "largest": np.zeros((0, 3))}
    out = junk()
    call = PartCall(
        engine.FeedbackAcceleration,
        feedback={**feedback, "offset": offset},
        e=doubled,
        e_dot=np.zeros(2),
        out=out,
    )
    planned([call]).run(0.0)
    np.testing.assert_array_equal(out, 3.0 * offset.source)


def test_a_call_of_the_time_is_made_before_those_that_read_the_state() -> None:
    line, moved = UniformLine([1.0, 2.0], start=[0.0, 1.0]), Motion()
    out = TrajectorySample.allocate(2)
    copy = PartCall(engine.Copy, x=out.position, out=moved.source)
    plan = planned(
        [PartCall(add, x=moved, y=moved, out=junk()), copy, *line.calls(out)]
    )
    assert len(plan.follow) == 1
    plan.run(3.0)
    np.testing.assert_array_equal(moved.source, [3.0, 7.0])
