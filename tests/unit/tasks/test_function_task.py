"""A task whose value is a Python function: against an exact one, and mistakes."""

import re
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from loaded_robots import load
from task_cases import SECOND, TIME, Motion, placed, wobble

import hsp_control as hsp
from hsp_control import RobotState
from hsp_control.common.arrays import Array
from hsp_control.common.errors import HspControlError, TaskError
from hsp_control.tasks import FunctionTask


def elbow(state: RobotState) -> Array:
    """Two time-varying numbers, nonlinear in q and t."""
    x, y, z = state.position("panda_link4")
    return np.array([x * y + np.sin(2.0 * state.t) * z, z**2 - 0.3 * state.t**2 * x])


def exactly(state: RobotState) -> tuple[Array, Array, Array]:
    """Return y', J and J' of `elbow`, by hand."""
    frame = state.frame("panda_link4")
    (x, y, z), (u, v, w) = frame.position, frame.velocity[:3]
    t, s, c = state.t, np.sin(2.0 * state.t), np.cos(2.0 * state.t)
    slope = np.array([[y, x, s], [-0.3 * t**2, 0.0, 2.0 * z]])
    turned = np.array([[v, u, 2.0 * c], [-0.6 * t, 0.0, 2.0 * w]])
    J, J_dot = frame.jacobian[:3], frame.jacobian_dot[:3]
    rate = slope @ [u, v, w] + [2.0 * c * z, -0.6 * t * x]
    return rate, slope @ J, turned @ J + slope @ J_dot


GIVEN: dict[str, Callable[[RobotState], Array]] = {
    "rate_function": lambda state: exactly(state)[0],
    "jacobian_function": lambda state: exactly(state)[1],
    "jacobian_rate_function": lambda state: exactly(state)[2],
}


@pytest.mark.parametrize("given", [(), ("jacobian_function",), tuple(GIVEN)], ids=str)
def test_the_derivatives_are_those_of_the_function(given: tuple[str, ...]) -> None:
    """J, J' and e' against those by hand; omitted ones are accurate to 1e-8."""
    robot, rng = load("panda"), np.random.default_rng(3)
    task = placed(
        FunctionTask(
            elbow, wobble(np.zeros(2)), size=2, **{k: GIVEN[k] for k in given}
        ),
        robot,
    )
    for _ in range(5):
        state = robot.state(TIME, robot.random_configuration(rng), rng.normal(size=7))
        rate, J, J_dot = exactly(state)
        sample = task.evaluate(state)
        desired = task.followed.sample(TIME)
        tolerance = 1e-13 if len(given) == 3 else 1e-8
        np.testing.assert_allclose(sample.error, desired.position - elbow(state))
        for found, exact in (
            (sample.jacobian, J),
            (sample.jacobian_dot, J_dot),
            (sample.error_rate, desired.velocity - rate),
            (task.reference_rate(state), desired.velocity - rate + J @ state.v),
        ):
            np.testing.assert_allclose(found, exact, rtol=0, atol=tolerance)


@pytest.mark.parametrize("given", [(), tuple(GIVEN)], ids=["by differences", "given"])
def test_the_error_obeys_its_equation(given: tuple[str, ...]) -> None:
    """e'' + Kv e' + Kp e = 0 along a motion with J a + J'v = a_x.

    Second derivatives of e are differences of eighth order with a rounding of 1e-9 e''.
    An omitted J' adds its error, up to 1e-8.
    """
    robot, rng = load("panda"), np.random.default_rng(11)
    q, v = robot.random_configuration(rng), rng.normal(size=7)
    task = placed(
        FunctionTask(elbow, wobble(np.zeros(2)), size=2, gains=hsp.Gains(25.0, 10.0),
                     largest_error="none", **{k: GIVEN[k] for k in given}),
        robot,
    )  # fmt: skip
    sample = task.evaluate(robot.state(TIME, q, v))
    J, a = sample.jacobian, rng.normal(size=7)
    a += np.linalg.pinv(J) @ (sample.acceleration - sample.jacobian_dot @ v - J @ a)
    motion = Motion(robot, q, v, a)

    def error(s: float) -> Array:
        state = robot.state(TIME + s, motion.configuration(s), v)
        return task.followed.sample(TIME + s).position - elbow(state)

    e, e_dot, e_ddot = error(0.0), motion.derivative(error), motion.derivative(
        error, SECOND
    )  # fmt: skip
    residual = e_ddot + 10.0 * e_dot + 25.0 * e
    np.testing.assert_allclose(residual, 0.0, rtol=0, atol=1e-8 * np.abs(e_ddot).max())


def test_a_task_of_a_function_is_the_ready_one() -> None:
    """A frame's position as a function moves the arm like `FramePosition`."""
    robot = load("panda")
    circle = hsp.Circle(0.05, 2.0)

    def hand(state: RobotState) -> Array:
        return state.position("panda_tcp")

    def run(task: hsp.Task) -> hsp.Rollout:
        arm = hsp.Controller(robot, [task], hsp.JointCentering())
        return hsp.simulate(arm, robot.home(), duration=0.2, control_period=0.002)

    mine = run(FunctionTask(hand, circle, size=3, unit="m", blend=0.5, name="hand"))
    ready = run(hsp.FramePosition("panda_tcp", circle, blend=0.5, name="hand"))
    np.testing.assert_allclose(mine.q, ready.q, rtol=0, atol=1e-9)
    np.testing.assert_allclose(mine.tau, ready.tau, rtol=0, atol=1e-5)
    assert mine["task.hand.actual"].shape == (len(mine), 3)
    # It works with lower levels, schedules, changes and streamed targets, too.
    arm = hsp.Controller(
        robot, [hsp.FramePosition("panda_tcp"), FunctionTask(elbow, size=2, priority=2)]
    )
    arm.at(0.05).ramp(0.05).gains("function_task", hsp.Gains(natural_frequency=12.0))
    arm.at(0.05).ramp(0.05).remove("function_task")
    run = hsp.simulate(arm, robot.home(), duration=0.15, control_period=0.002)
    assert run.status == "completed"
    arm = hsp.Controller(robot, [FunctionTask(hand, size=3, unit="m", name="hand")])
    arm.compute(0.0, robot.home(), np.zeros(7))
    arm.set_target("hand", hand(arm.state) + np.array([0.0, 0.0, 0.05]))
    assert np.isfinite(arm.compute(0.001, robot.home(), np.zeros(7)).tau).all()


MISTAKES: list[tuple[dict[str, Any], str]] = [
    ({"function": lambda state: state.q[:3]}, "function returned array("),
    ({"function": lambda state: np.array([np.nan, 0.0])}, "needs 2 finite numbers"),
    ({"function": lambda state: np.zeros(3)}, "needs 2 finite numbers, or size=3"),
    ({"function": lambda state: "far"}, "function returned 'far'; needs 2 finite"),
    ({"function": elbow, "jacobian_function": lambda state: np.zeros((2, 6))},
     "jacobian_function returned array("),
    ({"function": elbow, "rate_function": lambda state: 0.0},
     "rate_function returned 0.0; needs 2 finite numbers"),
    ({"function": elbow, "trajectory": [0.0, 0.0, 0.0]},
     "trajectory: point has 3 coordinates [0.0, 0.0, 0.0]; needs 2"),
    ({"function": "elbow"}, "'elbow' is a str; needs the function itself"),
]  # fmt: skip


@pytest.mark.parametrize(("fields", "message"), MISTAKES)
def test_a_wrong_function_is_named(fields: dict[str, Any], message: str) -> None:
    robot = load("panda")
    with pytest.raises(HspControlError, match=re.escape(message)):
        placed(FunctionTask(size=2, **fields), robot).evaluate(
            robot.state(0.0, robot.home(), np.zeros(7))
        )


def test_one_number_needs_no_array() -> None:
    robot = load("panda")
    state = robot.state(0.0, robot.home(), np.zeros(7))
    task = FunctionTask(lambda state: state.position("panda_link4")[2])
    sample = placed(task, robot).evaluate(state)
    assert sample.jacobian.shape == (1, 7)
    np.testing.assert_allclose(
        sample.jacobian[0], state.frame("panda_link4").jacobian[2], atol=1e-10
    )
    slope = lambda state: state.frame("panda_link4").jacobian[2]  # noqa: E731
    task = FunctionTask(task.function, jacobian_function=slope)
    np.testing.assert_allclose(
        placed(task, robot).evaluate(state).jacobian[0], slope(state)
    )


def test_yaml_names_the_function() -> None:
    with pytest.raises(TaskError, match=r"no function|needs the function itself"):
        FunctionTask("elbow")  # type: ignore[arg-type]
