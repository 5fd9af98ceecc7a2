"""Check native calls of Pinocchio against its Python bindings, to the last bit."""

import copy
from collections.abc import Iterator
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from robot_cases import ROBOTS, assert_equal_terms, draw, everything

from hsp_control.common.arrays import Array
from hsp_control.engine import pinocchio_calls
from hsp_control.engine.pinocchio_calls import PinocchioCall
from hsp_control.engine.plans import bind


def given(*arguments: Any) -> dict[str, Any]:
    """Return arguments by name; their order is Pinocchio's."""
    return {f"_{i}": argument for i, argument in enumerate(arguments)}


def both(
    what: str, model: pin.Model, *vectors: Array
) -> tuple[pin.Data, pin.Data, Any]:
    """Return the data after the native call and after the bindings', and the call."""
    native, bound = model.createData(), model.createData()
    call = bind(getattr(pin, what), given(model, native, *vectors))
    call()
    getattr(pin, what)(model, bound, *vectors)
    return native, bound, call


@pytest.mark.parametrize("case", ROBOTS)
def test_native_calls_equal_the_bindings(case: str) -> None:
    """And they read the arrays anew each time: the second state is another one."""
    robot, q, v, rng = draw(case, seed=21)
    a, model = rng.standard_normal(robot.nv), robot.model
    calls = {
        "computeJointJacobiansTimeVariation": ((q, v), ("J", "dJ", "ov")),
        "rnea": ((q, v, a), ("tau",)),
        "crba": ((q,), ("M",)),
    }
    if not robot.mimics:
        calls["computeCoriolisMatrix"] = (q, v), ("C",)
        calls["computeCentroidalMapTimeVariation"] = (q, v), ("Ag", "dAg")
        calls["aba"] = ((q, v, a), ("ddq",))
    for what, (vectors, results) in calls.items():
        native, bound, call = both(what, model, *vectors)
        assert isinstance(call, PinocchioCall), pinocchio_calls.unknown()
        for name in results:
            np.testing.assert_array_equal(
                np.array(getattr(native, name)), np.array(getattr(bound, name))
            )
        q[:], v[:] = robot.random_configuration(rng), rng.standard_normal(robot.nv)
        a[:] = rng.standard_normal(robot.nv)
        call()
        again = model.createData()
        getattr(pin, what)(model, again, *vectors)
        for name in results[-1:]:
            found, expected = getattr(native, name), getattr(again, name)
            np.testing.assert_array_equal(np.array(found), np.array(expected))


def test_a_copied_call_computes_into_its_own_data() -> None:
    """A copy has its own model, data and arrays; the first call's stay as they are."""
    robot, q, v, rng = draw("panda", seed=22)
    native, bound, call = both("rnea", robot.model, q, v, rng.standard_normal(robot.nv))
    copied = copy.deepcopy(call)
    q[:] = robot.random_configuration(rng)
    copied()
    np.testing.assert_array_equal(native.tau, bound.tau)
    what, _, own, *_ = copied._arguments
    assert what == "rnea"
    np.testing.assert_array_equal(own.tau, bound.tau)


def test_what_is_not_packed_is_left_to_the_bindings() -> None:
    """They read other layouts, and refuse other sizes, where native code would not."""
    robot, q, v, _ = draw("panda", seed=24)
    spread = np.zeros((robot.nv, 2))
    spread[:, 0] = v
    native, bound, call = both(
        "computeJointJacobiansTimeVariation", robot.model, q, spread[:, 0]
    )
    assert not isinstance(call, PinocchioCall)
    np.testing.assert_array_equal(native.dJ, bound.dJ)
    call = bind(pin.crba, given(robot.model, native, q[:-1]))
    with pytest.raises(ValueError, match="size"):
        call()


@pytest.fixture
def no_library(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """Let Pinocchio's library have none of the functions."""
    monkeypatch.setattr(pinocchio_calls, "_address", lambda name: 0)
    pinocchio_calls.unknown.cache_clear()
    yield
    pinocchio_calls.unknown.cache_clear()


@pytest.mark.parametrize("case", ["panda", "solo12"])
def test_without_the_functions_the_bindings_are_called(
    case: str, request: pytest.FixtureRequest
) -> None:
    """The same terms to the last bit, and the reason names what is missing."""
    robot, q, v, _ = draw(case, seed=23)
    frame = robot.frame_names[-1]
    expected = everything(robot.state(0.0, q, v), frame)
    request.getfixturevalue("no_library")
    state = robot.state(0.0, q, v)
    assert not isinstance(state._inverse_dynamics, PinocchioCall)
    assert "computeJointJacobiansTimeVariation" in pinocchio_calls.unknown()
    assert_equal_terms(everything(state, frame), expected)
