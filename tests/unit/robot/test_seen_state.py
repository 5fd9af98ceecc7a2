"""Check that a controller's state cannot become inconsistent."""

import copy
import pickle
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from controller_cases import assert_same, contents, panda, states, track
from hypothesis import given
from hypothesis import strategies as st

from hsp_control import Controller, RobotState, TargetPosture
from hsp_control.common.exceptions import ImmutableError

ADVICE = (
    "cannot be assigned, as all terms belong to one t, q and v: call "
    r"state\.update\(t, q, v\)$"
)


def controller() -> Controller:
    return Controller(panda(), [track()], TargetPosture("home"), limits=None)


@pytest.mark.parametrize("name", ["t", "q", "v"])
def test_its_parts_are_not_assigned_or_written(name: str) -> None:
    law = controller()
    t, q, v = states(1)[0]
    before = contents(law.compute(t, q, v))
    state = law.state
    kept = getattr(state, name)
    with pytest.raises(ImmutableError, match=rf"^state\.{name} {ADVICE}"):
        setattr(state, name, getattr(state, name) + 1.0)
    if name != "t":
        with pytest.raises(ValueError, match="read-only"):
            kept[:] = 0.1
    assert getattr(state, name) is kept or name == "t"
    assert_same(contents(law.compute(state)), before)


@given(st.lists(st.tuples(st.integers(0, 4), st.booleans()), min_size=1, max_size=6))
def test_update_moves_all_of_it_and_shows_the_memory_itself(
    steps: list[tuple[int, bool]],
) -> None:
    """In any order with `compute` of numbers: q, v, t and terms belong together."""
    law, fresh = controller(), controller()
    state, known = law.state, states(5)
    for k, given_state in steps:
        t, q, v = known[k]
        expected = contents(fresh.compute(t, q, v))
        if given_state:
            assert state.update(t, q, v) is state
            found = law.compute(state)
        else:
            found = law.compute(t, q, v)
        assert_same(contents(found), expected)
        assert law.state is state
        assert state.t == t
        np.testing.assert_array_equal(state.q, q)
        np.testing.assert_array_equal(state.v, v)
        own = panda().state(t, q, v)
        np.testing.assert_array_equal(state.mass_matrix, own.mass_matrix)
        np.testing.assert_array_equal(
            state.position("panda_tcp"), own.position("panda_tcp")
        )


@pytest.mark.parametrize(
    "make", [copy.copy, copy.deepcopy, lambda s: pickle.loads(pickle.dumps(s))]
)
def test_a_copy_is_a_state_of_its_own(make: Callable[[Any], Any]) -> None:
    law = controller()
    t, q, v = states(1)[0]
    law.compute(t, q, v)
    other = make(law.state)
    assert type(other) is RobotState
    other.update(t + 1.0, q + 0.1, v)
    np.testing.assert_array_equal(law.state.q, q)
    np.testing.assert_array_equal(other.q, q + 0.1)
