"""Compensators are values: shared, compared, pickled, and checked."""

import pickle
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from compensation_cases import ALL, EVERYTHING, PANDA, Q0, H, circle, controller
from loaded_robots import load
from wording import wording

from hsp_control import Robot
from hsp_control.common.arrays import Array
from hsp_control.common.errors import CompensationError, ImmutableError
from hsp_control.control.compensation import (
    CompensatedController,
    Compensation,
    FrictionFeedForward,
    IntegralAction,
    MomentumObserver,
    Predictor,
    StartUpRamp,
    VelocityFilter,
)


def test_one_compensation_serves_many_commands_at_once() -> None:
    """Two interleaved and four in threads equal each one alone."""

    def efforts(q: Array, command: CompensatedController) -> Iterator[Array]:
        command.restart()
        for k in range(40):
            v = np.full(7, 1.0 * (k > 0))
            yield command.effort(k * H, q + 1e-3 * k, v, H).copy()

    starts = [Q0 + 0.02 * k for k in range(4)]
    alone = [
        np.array([*efforts(q, CompensatedController(controller(), ALL))])
        for q in starts
    ]
    assert np.abs(alone[0] - alone[1]).max() > 0.1
    pair = [efforts(q, CompensatedController(controller(), ALL)) for q in starts[:2]]
    for k, both in enumerate(zip(*pair, strict=True)):
        for tau, expected in zip(both, alone[:2], strict=True):
            np.testing.assert_array_equal(tau, expected[k])
    made = [CompensatedController(controller(), ALL) for _ in starts]
    with ThreadPoolExecutor(4) as threads:
        found = threads.map(lambda q, own: np.array([*efforts(q, own)]), starts, made)
        for each, expected in zip(found, alone, strict=True):
            np.testing.assert_array_equal(each, expected)
    assert Compensation(**EVERYTHING) == ALL


def test_compensators_are_values() -> None:
    ki = {"hand": [400.0, 800.0, 1200.0]}
    action = IntegralAction(2.0, ki=ki, tasks=["hand"], limit=8.0)
    own = replace(ALL, integral_action=action)
    same = replace(ALL, integral_action=replace(action))
    assert own == same != ALL
    assert hash(own) == hash(same)
    assert pickle.loads(pickle.dumps(own)) == own
    assert action != replace(action, ki={"hand": [400.0, 800.0, 1201.0]})
    ki["hand"][0] = 0.0
    assert np.asarray(action.ki["hand"]).tolist() == [400.0, 800.0, 1200.0]
    assert eval(repr(own)) == own
    with pytest.raises(ImmutableError):
        action.ki["arm"] = 1.0  # type: ignore[index]
    for each in (action, pickle.loads(pickle.dumps(action))):
        with pytest.raises(ValueError, match="read-only"):
            each.ki["hand"][0] = 1.0
    assert replace(own, momentum_observer=None).names == tuple(
        name for name in EVERYTHING if name != "momentum_observer"
    )


# --- refusals -----------------------------------------------------------------------


def walker() -> Robot:
    return load("solo12")


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (
            lambda: MomentumObserver(0.0),
            "MomentumObserver: bandwidth: 0.0 ... too small",
        ),
        (lambda: VelocityFilter(10.0, 3), "... order: unknown ... 3"),  # type: ignore[arg-type]
        (lambda: VelocityFilter(600.0, 2).coefficients(H), "... less than 500 Hz"),
        (lambda: Predictor(0, 0), "... predictor needs a delay"),
        (lambda: IntegralAction(), "... needs a rate"),
        (lambda: IntegralAction(ki={"hand": -1.0}), "... ki.hand: -1.0 ... negative"),
        (lambda: StartUpRamp(1.0, -1.0), "... natural_frequency: -1.0 ... negative"),
        (
            lambda: FrictionFeedForward(1.0, smoothing=0.0),
            "... smoothing: 0.0 ... too small",
        ),
        (
            lambda: on(friction_feed_forward=FrictionFeedForward([1.0])),
            "friction_feed_forward.coulomb: ... (1,) ... one number",
        ),
        (
            lambda: MomentumObserver(clip=[-1.0] * 7),
            "... clip.0: -1.0 ... greater than 0",
        ),
        (
            lambda: on(momentum_observer=MomentumObserver(clip=[1.0] * 6)),
            "momentum_observer.clip: ... 6 numbers ... 7",
        ),
        (
            lambda: on(integral_action=IntegralAction(1.0, tasks=["hnad"])),
            "integral_action.tasks: there is no ... 'hnad' ... 'hand'",
        ),
        (
            lambda: on(integral_action=IntegralAction(ki={"hnad": 1.0})),
            "integral_action.ki: there is no ... 'hnad' ... 'hand'",
        ),
    ],
)
def test_settings_that_make_no_sense(make: Any, message: str) -> None:
    with pytest.raises(CompensationError, match=wording(message)):
        make()


def on(**parts: Any) -> None:
    Compensation(**parts).check(PANDA, [circle()])


@pytest.mark.parametrize("name", ["momentum_observer", "predictor", "start_up_ramp"])
def test_a_robot_that_may_fall_cannot_have_some(name: str) -> None:
    robot = walker()
    with pytest.raises(
        CompensationError, match=f"{name}: solo12 has a free-flyer root"
    ):
        Compensation(**{name: EVERYTHING[name]}).check(robot, [])
    Compensation(
        velocity_filter=VelocityFilter(50.0),
        friction_feed_forward=FrictionFeedForward(0.1),
    ).check(robot, [])


def test_a_second_order_filter_is_the_bilinear_transform_of_butterworths() -> None:
    """Coefficients and impulse responses equal SciPy's."""
    from scipy import signal

    b, a = VelocityFilter(40.0, 2).coefficients(0.001)
    expected_b, expected_a = signal.butter(2, 40.0, fs=1000.0)
    assert b == pytest.approx(expected_b, rel=1e-12)
    assert (1.0, *a) == pytest.approx(expected_a, rel=1e-12)
