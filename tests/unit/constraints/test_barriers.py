"""User-defined barriers: their rows, their margins in the loop, and refusals."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from loaded_robots import panda
from runs import held

import hsp_control as hsp
from hsp_control.common.errors import FrameNotFoundError, LimitError
from hsp_control.declaration.quantities import Positive
from hsp_control.geometry.scene import Scene, Start


class FrameHeight(hsp.Barrier):
    """A frame stays above a height, which may rise."""

    frame: str = "panda_tcp"
    """The frame [-]."""
    rate: float = 0.0
    """How fast the height rises [m/s]."""

    def values(self, state: hsp.RobotState) -> float:
        """Return the height above the risen minimum."""
        return float(state.position(self.frame)[2]) - self.rate * state.t


class Reach(hsp.Barrier):
    """Elbow and hand stay within a distance from the base's axis."""

    radius: Positive
    """The distance [m]."""

    def values(self, state: hsp.RobotState) -> list[float]:
        """Return r² - x² - y² of both."""
        places = [state.position(f) for f in ("panda_link4", "panda_tcp")]
        return [self.radius**2 - x * x - y * y for x, y, _ in places]


class Given(hsp.Barrier):
    """Values as given."""

    function: Callable[[hsp.RobotState], Any]
    """h of a state [-]."""

    def values(self, state: hsp.RobotState) -> Any:
        return self.function(state)


class Later(FrameHeight):
    """A barrier far away, whose gradients are wrong from a time on."""

    wrong: Any = None
    """What `gradients` returns then [-]."""

    def values(self, state: hsp.RobotState) -> float:
        return 10.0

    def gradients(self, state: hsp.RobotState) -> Any:
        return self.wrong if state.t > 0.01 else np.zeros((1, 7))


class Flat(FrameHeight):
    """The Jacobian of the only row has one dimension too few."""

    def gradients(self, state: hsp.RobotState) -> Any:
        return np.ones(7)


def at_home() -> Start:
    robot = panda()
    return Start(robot.state(0.0, robot.home(), np.zeros(7)), Scene())


@given(seed=st.integers(0, 2**32 - 1))
def test_rows_are_the_barriers_second_derivative(seed: int) -> None:
    """A a - b = h'' + 2α h' + α² (h - minimum) along q ⊕ (s v + ½ s² a), at t + s."""
    robot, rng = panda(), np.random.default_rng(seed)
    v, a = rng.standard_normal((2, 7))
    q = robot.integrate(robot.home(), 0.5 * rng.standard_normal(7))
    for limit in (FrameHeight(minimum=0.1, rate=0.3), Reach(0.5)):
        limit = limit.placed(at_home())

        def h(s: float, limit: hsp.Barrier = limit) -> Any:
            there = robot.integrate(q, s * v + 0.5 * s * s * a)
            return np.array(limit.values(robot.state(0.4 + s, there, v)))

        e = 1e-3
        rate, second = (h(e) - h(-e)) / (2 * e), (h(e) - 2 * h(0) + h(-e)) / e**2
        A, b = limit.rows(robot.state(0.4, q, v), 10.0, np.zeros(7))
        expected = second + 20.0 * rate + 100.0 * (h(0) - limit.minimum)
        # differences over 3 ms and over 1 ms, of values up to 1000
        np.testing.assert_allclose(A @ a - b, np.atleast_1d(expected), atol=0.02)


@pytest.mark.slow
def test_a_hand_that_is_drawn_below_stays_above() -> None:
    """The frame rests at the barrier; a distant barrier changes no effort."""
    robot = panda()
    here = robot.state(0.0, robot.home(), np.zeros(7)).position("panda_tcp")
    deep = hsp.Hold(here + np.array([0.1, 0.05, -0.3]))
    task = hsp.FramePosition("panda_tcp", deep, name="hand")
    barrier = FrameHeight(minimum=here[2] - 0.1)
    law = hsp.Controller(robot, [task], limits=hsp.Limits(barriers=[barrier]))
    run = held(law, robot.home(), duration=2.2)
    heights = here[2] - 0.3 - run["task.hand.error"][:, 2]
    assert heights.min() > barrier.minimum - 1e-4
    assert heights[-1] == pytest.approx(barrier.minimum, abs=1e-3)
    assert np.abs(run["v"][-1]).max() < 1e-3
    assert run["status"].max() == 2  # nothing was relaxed
    far = hsp.Controller(
        robot, [task], limits=hsp.Limits(barriers=[FrameHeight(minimum=-9.0)])
    )
    free = hsp.Controller(robot, [task])
    state = robot.state(0.0, robot.home(), np.full(7, 0.1))
    np.testing.assert_array_equal(far.compute(state).tau, free.compute(state).tau)


@pytest.mark.parametrize(
    ("barrier", "error", "message"),
    [
        (
            FrameHeight(frame="panda_tpc"),
            FrameNotFoundError,
            "did you mean 'panda_tcp'",
        ),
        (
            FrameHeight(minimum=2.0),
            LimitError,
            r"FrameHeight is 0\.\d+, must be at least 2",
        ),
        (Flat(), LimitError, r"gradients of shape \(7,\) at t = 0 s; needs .*\(1, 7\)"),
        (Given(lambda _: np.nan), LimitError, "Given has the values nan at t = 0 s"),
        (Given(lambda _: []), LimitError, "needs finite numbers, one or shape"),
        (Given(lambda _: None), LimitError, "has the values None"),
        (Given(lambda _: "high"), LimitError, "has the values 'high'"),
        (Given(lambda _: np.eye(2)), LimitError, "has the values array"),
    ],
)
def test_mistakes(barrier: Any, error: type[Exception], message: str) -> None:
    with pytest.raises(error, match=message) as caught:
        hsp.Limits(barriers=[barrier]).placed(at_home()).check_start(
            panda().home(), np.zeros(7)
        )
    if "must be at least" not in message:
        assert caught.value.path[:2] == ("barriers", 0)  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (np.full((1, 7), np.nan), "gradients with NaN or inf at t = 0.02 s"),
        (np.zeros((2, 7)), r"gradients of shape \(2, 7\) at t = 0.02 s"),
        (None, "has gradients None at t = 0.02 s"),
        ("none", "has gradients 'none' at t = 0.02 s"),
    ],
)
def test_wrong_gradients_take_no_other_limit_away(wrong: Any, message: str) -> None:
    """A NaN ended the search for an effort, which then kept no joint from its stop."""
    limits = hsp.Limits(barriers=[Later(frame="panda_tcp", wrong=wrong)])
    controller = hsp.Controller(
        panda(), [hsp.FramePosition("panda_tcp", name="hand")], limits=limits
    )
    q, v = panda().home(), np.zeros(7)
    for t in (0.0, 0.01):
        controller.compute(t, q, v)
    with pytest.raises(LimitError, match=message):
        controller.compute(0.02, q, v)
