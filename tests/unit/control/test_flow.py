"""The flow: a start on it has no transient, and robots converge to it."""

import numpy as np
import pytest
from controller_cases import (
    EXACT,
    METRICS,
    circle,
    hold_orientation,
    metrics,
    states,
    track,
)
from loaded_robots import panda
from runs import continuous

import hsp_control as hsp
from hsp_control.common.arrays import Array
from hsp_control.null_space.fields import FunctionField
from hsp_control.null_space.metrics import MetricSample


def swaying_posture(state: hsp.RobotState) -> Array:
    """A field that moves in time: the joints follow sines about the home posture."""
    away = panda().home() - state.q
    return 2.0 * away + np.sin(state.t + np.arange(7.0))


@metrics
def test_flow_meets_the_task_and_follows_the_field(kind: str) -> None:
    """v = J#x_d' + P g: J v = x_d', and ‖v - g‖_W is minimal."""
    metric = METRICS[kind](7)
    field = FunctionField(swaying_posture)
    tasks = [track(), hold_orientation()]
    controller = hsp.Controller(
        panda(), tasks, field, metric=metric, singularity_threshold=EXACT
    )
    for t, q, _ in states(3, seed=5):
        v = controller.flow(t, q)
        state = panda().state(t, q, v)
        J = np.vstack([task.evaluate(state).jacobian for task in tasks])
        rate = np.concatenate([circle().sample(t).velocity, np.zeros(3)])
        np.testing.assert_allclose(J @ v, rate, rtol=0, atol=1e-12)
        W = metric.evaluate(state, MetricSample.allocate(7)).W
        null = np.linalg.svd(J)[2][6:]
        g = swaying_posture(state)
        # P(g - v) = 0: on the flow the null-space error is zero.
        np.testing.assert_allclose(null @ W @ (g - v), 0.0, rtol=0, atol=1e-10)
        e_N = controller.compute(state).null_space_error
        np.testing.assert_allclose(e_N, 0.0, rtol=0, atol=1e-11)


@pytest.mark.slow
@metrics
def test_robot_becomes_the_flow(kind: str) -> None:
    """After the transients the simulated velocity is flow(t, q), in every metric.

    Started off the path and moving: exp(-20 · 1.5) = 1e-13 is left of both errors.
    """
    controller = hsp.Controller(
        panda(),
        [track()],
        FunctionField(swaying_posture),
        metric=METRICS[kind](7),
        null_space_gain=20.0,
        singularity_threshold=EXACT,
    )
    v0 = 0.2 * np.ones(7)
    rollout = continuous(controller, panda().home(), v0, duration=1.5, log_period=0.25)
    gaps = [
        np.abs(v - controller.flow(t, q)).max()
        for t, q, v in zip(rollout.t, rollout.q, rollout.v, strict=True)
    ]
    # Before, both errors decay like (1 + 20 t) exp(-20 t); at the end the integrator's
    # tolerance remains.
    assert gaps[0] > 0.1
    assert gaps[-1] < 1e-8
    # The flow itself moves: the robot follows a moving reference.
    assert np.abs(rollout.v[-1]).max() > 0.1


def test_looking_ahead_moves_nothing() -> None:
    """Reading the flow changes neither the time, nor the start, nor later changes."""
    robot = hsp.Robot.load("panda")
    q, v = robot.home(), np.zeros(7)
    far = q + 0.2

    def law() -> hsp.Controller:
        circle = hsp.Circle(radius=0.05, angular_rate=1.0)
        hand = hsp.FramePosition("panda_tcp", circle, name="hand")
        controller = hsp.Controller(robot, [hand], hsp.JointCentering(), limits=None)
        controller.at(0.5).gains("hand", hsp.Gains(natural_frequency=20.0))
        return controller

    def steps(controller: hsp.Controller, *, looking: bool) -> list[bytes]:
        found = []
        for k in range(30):
            if looking:
                controller.flow(10.0 + k, far)
                controller.stack(robot.state(20.0 + k, far, v))
            if looking and k:
                assert controller.state.t == 0.05 * (k - 1)
            if k == 3:
                gains = hsp.Gains(natural_frequency=5.0)
                controller.at(1.0).gains("hand", gains)
                assert [each.at for each in controller.changes] == [0.5, 1.0]
            found.append(controller.compute(0.05 * k, q, v).tau.tobytes())
        return found

    assert steps(law(), looking=True) == steps(law(), looking=False)
