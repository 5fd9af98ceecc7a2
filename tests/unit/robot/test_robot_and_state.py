"""A robot's names and copies, and a state that cannot become inconsistent."""

import copy
import pickle
import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from controller_cases import assert_same, contents, states, track
from hypothesis import given
from hypothesis import strategies as st
from loaded_robots import panda
from robot_cases import ROBOTS, assert_equal_terms, by_pickle, draw, everything, load
from wording import wording

from hsp_control import Controller, Robot, RobotState, TargetPosture
from hsp_control.common.errors import (
    FrameNotFoundError,
    ImmutableError,
    JointNotFoundError,
    ModelError,
)

ADVICE = wording("... cannot be assigned ... state.update(t, q, v)")


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
    """Interleaved with `compute` of numbers: q, v, t and terms stay consistent."""
    law, fresh = controller(), controller()
    for each in (law, fresh):
        each.restart(origin=0.0)
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
def test_a_copy_is_an_independent_state(make: Callable[[Any], Any]) -> None:
    law = controller()
    t, q, v = states(1)[0]
    law.compute(t, q, v)
    other = make(law.state)
    assert type(other) is RobotState
    other.update(t + 1.0, q + 0.1, v)
    np.testing.assert_array_equal(law.state.q, q)
    np.testing.assert_array_equal(other.q, q + 0.1)


# --- names ---------------------------------------------------------------------------


def test_unknown_frame() -> None:
    robot, q, v, _ = draw("panda", seed=22)
    message = (
        "no frame 'panda_hnad'; did you mean 'panda_hand'? (the model has universe"
    )
    for ask in (robot.frame_id, robot.state(0.0, q, v).frame):
        with pytest.raises(FrameNotFoundError, match=re.escape(message)) as caught:
            ask("panda_hnad")
        assert isinstance(caught.value, LookupError)
    with pytest.raises(FrameNotFoundError, match="did you mean 'panda_hand'"):
        robot.frame_id("hand")


@pytest.mark.parametrize("name", [3, ["panda_hand"], None])
def test_objects_that_are_no_names_are_refused(name: Any) -> None:
    robot = draw("panda", seed=22)[0]
    with pytest.raises(FrameNotFoundError, match=re.escape(f"no frame {name!r} (")):
        robot.frame_id(name)
    with pytest.raises(JointNotFoundError, match=re.escape(f"no joint {name!r} (")):
        robot.velocity_index(name)


@pytest.mark.parametrize(("joint", "hint"), [
    ("panda_joint8", "; did you mean 'panda_joint"),
    ("panda_finger_joint1", "; did you mean 'panda_joint"),  # locked
    ("universe", " (the model has panda_joint1, "),  # Pinocchio's universe, not a joint
    ("panda_hand", " (the model has panda_joint1, "),  # a frame
])  # fmt: skip
def test_unknown_joint(joint: str, hint: str) -> None:
    with pytest.raises(JointNotFoundError, match=re.escape(f"no joint {joint!r}")) as e:
        load("panda").velocity_index(joint)
    assert hint in str(e.value)
    assert isinstance(e.value, LookupError)


# --- persistence ---------------------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
@pytest.mark.parametrize("duplicate", [by_pickle, copy.deepcopy])
def test_pickle_and_deep_copy_round_trip(
    case: str, duplicate: Callable[[Robot], Robot]
) -> None:
    """The copy is another object with the same results, bit for bit."""
    robot, q, v, _ = draw(case, seed=28)
    if robot.mimics and duplicate is by_pickle:
        # Pinocchio would restore a model that crashes the process.
        with pytest.raises(
            ModelError, match=r"mimic joints cannot be pickled; .*False"
        ):
            pickle.dumps(robot)
        return
    other = duplicate(robot)
    assert other is not robot
    assert other.model is not robot.model
    assert other.source == robot.source
    assert repr(other) == repr(robot)
    for name in ("joint_names", "dof_names", "frame_names", "unit_blocks"):
        assert getattr(other, name) == getattr(robot, name)
    np.testing.assert_array_equal(other.home(), robot.home())
    frame = robot.frame_names[-1]
    assert_equal_terms(
        everything(other.state(0.0, q, v), frame),
        everything(robot.state(0.0, q, v), frame),
    )
    np.testing.assert_array_equal(
        other.forward_dynamics(q, v, v), robot.forward_dynamics(q, v, v)
    )
