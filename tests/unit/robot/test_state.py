"""A state can be moved, read in any order, and given wrong numbers."""

import gc
import itertools
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from places import THOROUGH
from robot_cases import ROBOTS, assert_equal_terms, draw, everything, load
from wording import wording

from hsp_control import HspControlError, RobotState
from hsp_control.common.arrays import Array
from hsp_control.common.errors import ConfigurationError, NonFiniteError, ShapeError
from hsp_control.engine import PythonCall

# --- one state, many moves -----------------------------------------------------------


@pytest.mark.parametrize("case", ROBOTS)
def test_update_moves_everything(case: str) -> None:
    """A used state that is moved equals a fresh one there, to the last bit."""
    robot, q, v, rng = draw(case, seed=12)
    frame = robot.frame_names[-1]
    used = robot.state(0.0, q, v)
    everything(used, frame)
    for _ in range(3):
        q, v = robot.random_configuration(rng), rng.standard_normal(robot.nv)
        t = float(rng.uniform())
        assert used.update(t, q, v) is used
        assert used.t == t
        np.testing.assert_array_equal(used.q, q)
        np.testing.assert_array_equal(used.v, v)
        fresh = robot.state(t, q, v)
        assert_equal_terms(everything(used, frame), everything(fresh, frame))


@pytest.mark.slow
@pytest.mark.parametrize("case", ["panda", "panda_fingers", "solo12"])
def test_order_of_questions_does_not_matter(case: str) -> None:
    """Pinocchio's algorithms share one memory: none may overwrite another's results."""
    robot, q, v, _ = draw(case, seed=13)
    name = robot.frame_names[-1]
    a = np.ones(robot.nv)
    questions: dict[str, Callable[[RobotState], Array]] = {
        "mass_matrix": lambda s: s.mass_matrix,
        "mass_matrix_rate": lambda s: s.mass_matrix_rate,
        "nonlinear_effects": lambda s: s.nonlinear_effects,
        "effort": lambda s: s.inverse_dynamics(a),
        "jacobian": lambda s: s.frame(name).jacobian,
        "jacobian_dot": lambda s: s.frame(name).jacobian_dot,
    }
    alone = {
        what: question(robot.state(0.0, q, v)).copy()
        for what, question in questions.items()
    }
    # One call may leave a Jacobian that another recomputes: equal up to rounding only.
    orders = list(itertools.permutations(questions))
    for order in orders if THOROUGH else orders[::7]:  # all occur in all positions
        state = robot.state(0.0, q, v)
        first = {what: questions[what](state) for what in order}
        for what in order:
            for answer in (first[what], questions[what](state)):
                np.testing.assert_allclose(
                    answer, alone[what], rtol=1e-13, atol=1e-13, err_msg=what
                )


@pytest.mark.parametrize("case", ["planar3r", "panda", "panda_fingers", "solo12"])
def test_companion_states_do_not_disturb(case: str) -> None:
    """`displaced` and `ahead` return other states; the state itself is unchanged."""
    robot, q, v, rng = draw(case, seed=15)
    name = robot.frame_names[-1]
    state = robot.state(0.5, q, v)
    before = everything(state, name)
    displacement = rng.standard_normal(robot.nv)
    companion = state.displaced(0.25, displacement)
    assert companion is not state
    assert companion.t == 0.75
    np.testing.assert_array_equal(companion.q, robot.integrate(q, displacement))
    np.testing.assert_array_equal(companion.v, v)
    there = robot.state(0.75, robot.integrate(q, displacement), v)
    assert_equal_terms(everything(companion, name), everything(there, name))

    # A displaced state's displaced state is a third one: nested differences work.
    again = companion.displaced(0.25, -displacement)
    assert again is not companion
    assert companion.t == 0.75
    np.testing.assert_array_equal(companion.q, there.q)

    ahead = state.ahead(0.01)
    assert ahead.t == 0.51
    np.testing.assert_array_equal(ahead.q, robot.integrate(q, 0.01 * v))
    np.testing.assert_array_equal(ahead.v, v)
    assert state.t == 0.5
    np.testing.assert_array_equal(state.q, q)
    # Unchanged, not merely recomputed: arrays returned earlier have the same values.
    assert_equal_terms(everything(state, name), before)


def test_arrays_outlive_the_state_that_they_came_from() -> None:
    """They are views into Pinocchio's memory, which they must keep alive."""
    robot, rng = load("panda"), np.random.default_rng(18)
    held = []
    for _ in range(50):
        q, v = robot.random_configuration(rng), rng.standard_normal(7)
        frame = robot.state(0.0, q, v).frame("panda_hand")
        M = robot.state(0.0, q, v).mass_matrix
        held.append((frame, frame.position.copy(), frame.rotation.copy(), M, M.copy()))
        gc.collect(0)
        np.full(2000, np.nan)  # otherwise written to freed memory
    for frame, position, rotation, M, M_kept in held:
        np.testing.assert_array_equal(frame.position, position)
        np.testing.assert_array_equal(frame.rotation, rotation)
        np.testing.assert_array_equal(M, M_kept)


# --- invalid input -------------------------------------------------------------------


def poisoned(vector: Array, value: float, place: int = 1) -> Array:
    copied = vector.copy()
    copied[place] = value
    return copied


BAD_STATES: dict[str, tuple[Callable[[Array, Array], tuple[Any, Any, Any]], Any, str]]
BAD_STATES = {
    "NaN in q": (lambda q, v: (0.0, poisoned(q, np.nan), v), NonFiniteError,
                 "configuration q[1] ... nan ... finite"),
    "infinities that cancel": (
        lambda q, v: (0.0, q, poisoned(poisoned(v, np.inf), -np.inf, 2)),
        NonFiniteError, "velocity v[1] ... inf ... finite"),
    "infinite t": (lambda q, v: (np.inf, q, v), NonFiniteError,
                   "time t ... inf ... finite"),
    "short q": (lambda q, v: (0.0, q[:-1], v), ShapeError,
                "configuration q ... (18,) ... (19,)"),
    "q where v belongs": (lambda q, v: (0.0, q, q), ShapeError,
                          "velocity v ... (19,) ... (18,)"),
    "column": (lambda q, v: (0.0, q[:, None], v), ShapeError,
               "configuration q has shape (19, 1)"),
    "words": (lambda q, v: (0.0, ["a"] * 19, v), ShapeError,
              "configuration q ... ['a', ... 19 numbers"),
    "nothing": (lambda q, v: (0.0, q, {}), ShapeError,
                "velocity v is {} ... 18 numbers"),
    "quaternion of norm 2": (
        lambda q, v: (0.0, np.concatenate([q[:3], 2 * q[3:7], q[7:]]), v),
        ConfigurationError, "... q[3:7] = ... norm 2"),
}  # fmt: skip


@pytest.mark.filterwarnings("ignore:invalid value encountered:RuntimeWarning")
@pytest.mark.parametrize("bad", BAD_STATES)
def test_bad_state_is_refused_and_leaves_the_old_one(bad: str) -> None:
    robot, q, v, _ = draw("solo12", seed=19)
    spoil, error, message = BAD_STATES[bad]
    state = robot.state(0.5, q, v)
    name = robot.frame_names[-1]
    before = everything(state, name)
    with pytest.raises(error, match=wording(message)) as caught:
        state.update(*spoil(q, v))
    assert isinstance(caught.value, HspControlError)
    assert isinstance(caught.value, ValueError)
    with pytest.raises(error, match=wording(message)):
        robot.state(*spoil(q, v))
    # Half a move would leave terms that disagree with q and v.
    assert state.t == 0.5
    np.testing.assert_array_equal(state.q, q)
    np.testing.assert_array_equal(state.v, v)
    assert_equal_terms(everything(state, name), before)


# --- moves with calls that follow ----------------------------------------------------


def test_calls_after_a_move_see_its_time_and_state() -> None:
    """Also Python calls, such as a user's field."""
    robot, q, v, _ = draw("panda", seed=31)
    state, seen = robot.state(0.0, q, v), list[tuple[float, float, Array]]()

    def call(t: float) -> float:
        seen.append((t, state.t, state.q.copy()))
        return 7.0

    move = state.bind_move([PythonCall(call, timed=True)])
    assert state.advance(move, 0.25, q + 0.1, v) == 7.0
    ((t, own, where),) = seen
    assert t == own == 0.25
    np.testing.assert_array_equal(where, q + 0.1)


def test_a_refused_move_changes_nothing_and_calls_nothing() -> None:
    robot, q, v, _ = draw("panda", seed=32)
    state, seen = robot.state(0.5, q, v), list[float]()
    move = state.bind_move([PythonCall(seen.append, timed=True)])
    with pytest.raises(NonFiniteError, match="velocity v"):
        state.advance(move, 1.0, q, np.full(robot.nv, np.nan))
    with pytest.raises(NonFiniteError, match="time t is None"):
        state.advance(move, None, q, v)  # type: ignore[arg-type]
    assert (state.t, seen) == (0.5, [])
    np.testing.assert_array_equal(state.v, v)


def test_a_type_error_of_a_call_is_its_own() -> None:
    """It is not reported as an error of the time."""
    robot, q, v, _ = draw("panda", seed=33)
    state = robot.state(0.0, q, v)

    def call(t: float) -> float:
        raise TypeError("a field's own mistake")

    with pytest.raises(TypeError, match="a field's own mistake"):
        state.advance(state.bind_move([PythonCall(call, timed=True)]), 1.0, q, v)
