"""The sampled loop of an elastic joint, against a simulated one."""

from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from carriage import MASS, carriage, check_that_it_is_the_loop
from compensators import only
from scipy.integrate import solve_ivp

import hsp_control as hsp
from hsp_control import Controller, Gains, JointPosture, Robot, simulate
from hsp_control.common.arrays import Array
from hsp_control.control.compensation.linear_loop import ElasticJoint, LinearLoop
from hsp_control.simulation.plants import EffortDelay, ImperfectPlant, SampledPlant
from hsp_control.simulation.plants.sensors import SensorDelay

H, OMEGA = 0.001, 20.0


class Sprung(SampledPlant):
    """A carriage that a motor drives through a spring, with link-side sensors."""

    def __init__(self, robot: Robot, joint: ElasticJoint) -> None:
        super().__init__(robot)
        self.joint, self.state = joint, np.zeros(4)

    def reset(self, t: float, q: Array, v: Array) -> None:
        self.state = np.array([q[0], v[0], q[0], v[0]])

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        transition, effect = self.joint.transition(end - t)
        self.state = transition @ self.state + effect * tau[0] / MASS
        return self.state[:1].copy(), self.state[1:2].copy()

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        begin = 2 if self.joint.measured == "motor" else 0
        return self.state[begin : begin + 1].copy(), self.state[begin + 1 :][:1].copy()


def elastic(measured: Literal["motor", "link"], stiffness: float = 5e3) -> ElasticJoint:
    """Return a joint like a Panda's first ones, with a damping ratio of 2 %."""
    link, motor = 2.0 / 3.0, 1.0 / 3.0
    damping = 2.0 * 0.02 * np.sqrt(stiffness * link * motor)
    return ElasticJoint(link, motor, stiffness, damping, measured)


def test_the_transition_is_the_solution_of_the_equations() -> None:
    joint = ElasticJoint(1.7, 0.4, 300.0, 2.0)
    transition, effect = joint.transition(0.05)

    def rates(_: float, s: Array) -> Array:
        pull = 300.0 * (s[2] - s[0]) + 2.0 * (s[3] - s[1])
        return np.array([s[1], pull / 1.7, s[3], (3.0 - pull) / 0.4])

    begin = np.array([0.1, -0.2, 0.3, 0.4])
    found = solve_ivp(rates, (0.0, 0.05), begin, rtol=1e-10, atol=1e-12).y[:, -1]
    np.testing.assert_allclose(transition @ begin + effect * 3.0, found, atol=1e-8)


@pytest.mark.parametrize("measured", ["motor", "link"])
@pytest.mark.parametrize(
    ("delays", "compensation"),
    [
        ((0, 0), {}),
        ((1, 2), {"integral_action": hsp.compensation.IntegralAction(5.0)}),
        ((1, 0), {"predictor": hsp.compensation.Predictor(1, 0)}),
        ((0, 1), {"velocity_filter": hsp.compensation.VelocityFilter(40.0, 2)}),
        ((0, 2), {"momentum_observer": hsp.compensation.MomentumObserver(2.0)}),
    ],
)
def test_a_simulated_joint_obeys_the_loop_s_polynomial(
    delays: tuple[int, int],
    compensation: dict[str, Any],
    measured: Literal["motor", "link"],
    tmp_path: Path,
) -> None:
    robot = carriage(tmp_path)
    h, joint = 0.01, elastic(measured, 400.0)
    task = JointPosture(np.zeros(1), gains=Gains(natural_frequency=8.0))
    made, parts = (
        Controller(robot, [task], limits=None),
        only(**compensation),
    )
    plant = ImperfectPlant(
        Sprung(robot, joint), [SensorDelay(delays[1])], [EffortDelay(delays[0])]
    )
    x = simulate(
        made, [1.0], duration=0.6, control_period=h, log_period=h, plant=plant,
        compensation=parts, check_rate=False,
    ).q[:, 0]  # fmt: skip
    Kp, Kv, *_ = made.feedback("posture")
    action = parts.integral_action
    Ki = np.zeros((1, 1)) if action is None else action.gains(made.tasks)["posture"]
    loop = LinearLoop(Kp, Kv, Ki, h, *delays, parts, joint=joint)
    other = LinearLoop(1.1 * Kp, Kv, Ki, h, *delays, parts, joint=joint)
    check_that_it_is_the_loop(x, loop, other, rounding=1e-11)
