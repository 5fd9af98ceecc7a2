"""A robot of one joint: Pinocchio returns single-column matrices as vectors."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from hsp_control import (
    CenterOfMass,
    Controller,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Limits,
    Obstacle,
    ObstacleClearance,
    Robot,
    Sphere,
    TargetPosture,
    simulate,
)
from hsp_control.common.arrays import Array
from hsp_control.constraints.limits import ObstacleDistance
from hsp_control.null_space.metrics import IdentityMetric, MassMatrixMetric
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import Push, RigidBodyPlant

MASS, LEVER, INERTIA, LENGTH = 2.0, 0.2, 0.1, 0.4
PENDULUM = f"""<robot name="pendulum">
  <link name="base"/>
  <link name="rod">
    <inertial><origin xyz="0 0 {LEVER}"/><mass value="{MASS}"/>
      <inertia ixx="0.1" iyy="{INERTIA}" izz="0.1" ixy="0" ixz="0" iyz="0"/></inertial>
    <collision><origin xyz="0 0 {LEVER}"/><geometry><sphere radius="0.05"/></geometry>
    </collision>
  </link>
  <link name="tip"/>
  <joint name="pivot" type="revolute"><parent link="base"/><child link="rod"/>
    <axis xyz="0 1 0"/><limit lower="-3" upper="3" effort="90" velocity="9"/></joint>
  <joint name="end" type="fixed"><parent link="rod"/><child link="tip"/>
    <origin xyz="0 0 {LENGTH}"/></joint>
</robot>"""


@pytest.fixture
def robot(tmp_path: Path) -> Robot:
    file = tmp_path / "pendulum.urdf"
    file.write_text(PENDULUM)
    return Robot.load(file)


def turning(length: float, angle: float) -> Array:
    """Return ∂/∂angle of the position of a point on the rod."""
    return length * np.array([np.cos(angle), 0.0, -np.sin(angle)])


def falling(length: float, angle: float) -> Array:
    """Return ∂²/∂angle² of the position of a point on the rod."""
    return length * np.array([-np.sin(angle), 0.0, -np.cos(angle)])


def test_terms_are_the_pendulums_at_every_state(robot: Robot) -> None:
    """Arrays are views of the state: requested once, and read after a move."""
    state = robot.state(0.0, [0.0], [0.0])
    tip, mass, world = state.frame("tip"), state.centroidal, state.world
    for angle, rate in ((0.3, 1.5), (-2.0, -0.4)):
        state.update(0.0, np.array([angle]), np.array([rate]))
        state.frame("tip")
        assert state.centroidal is mass  # moved, too
        for got, wanted in (
            (tip.jacobian[:3, 0], turning(LENGTH, angle)),
            (tip.jacobian[3:, 0], [0.0, 1.0, 0.0]),
            (tip.jacobian_dot[:3, 0], rate * falling(LENGTH, angle)),
            (tip.drift[:3], rate**2 * falling(LENGTH, angle)),
            (mass.jacobian[:, 0], turning(LEVER, angle)),
            (mass.jacobian_dot[:, 0], rate * falling(LEVER, angle)),
            (mass.momentum_matrix[:, 0], [0.0, INERTIA, 0.0]),
            (world.jacobian[:, 0], [0.0, 0.0, 0.0, 0.0, 1.0, 0.0]),
            (state.mass_matrix, [[INERTIA + MASS * LEVER**2]]),
            (state.mass_matrix_rate, [[0.0]]),
        ):
            np.testing.assert_allclose(got, wanted, rtol=0, atol=1e-12)


def gains() -> Gains:
    return Gains(natural_frequency=10.0)


def controlled(robot: Robot, task: str, metric: Any) -> Controller:
    tasks = {
        "position": lambda: FramePosition(
            "tip", Hold([0.1]), gains=gains(), axes="x", largest_error="none", name="it"
        ),
        "center of mass": lambda: CenterOfMass(
            Hold([0.05]), gains=gains(), axes="x", largest_error="none", name="it"
        ),
        "posture": lambda: JointPosture([0.2], gains=gains(), name="it"),
    }
    field = TargetPosture([0.0])
    return Controller(robot, [tasks[task]()], field, null_space_gain=5.0, metric=metric)


@pytest.mark.parametrize("task", ["position", "center of mass", "posture"])
@pytest.mark.parametrize("metric", [IdentityMetric, MassMatrixMetric])
def test_the_error_equation_in_closed_loop(
    robot: Robot, task: str, metric: Any
) -> None:
    """Critically damped: e(t) = e(0) (1 + 10 t) exp(-10 t) from rest."""
    controller = controlled(robot, task, metric())
    run = simulate(controller, [0.6], duration=0.5)
    t = run.t[:, None]
    expected = run["task.it.error"][0] * (1.0 + 10.0 * t) * np.exp(-10.0 * t)
    np.testing.assert_allclose(run["task.it.error"], expected, rtol=0, atol=1e-8)
    assert np.abs(run["null_space_error"]).max() < 1e-9  # it has decayed


def test_within_limits_beside_a_ball_and_pushed(robot: Robot) -> None:
    ball = Obstacle("ball", Sphere(0.1), Hold([0.3, 0.0, 0.1]))
    clearance = ObstacleClearance([ball])
    limits = Limits(barriers=[ObstacleDistance(0.02, obstacles=[ball])])
    task = FramePosition("tip", Hold([0.39]), gains=gains(), axes="x", name="it")
    controller = Controller(
        robot, [task], clearance, null_space_gain=5.0, limits=limits
    )
    push = Push("tip", force=(20.0, 0.0, 0.0), start=0.2, duration=0.05)
    run = simulate(
        controller,
        [0.1],
        duration=0.6,
        control_period=1e-3,
        plant=RigidBodyPlant(robot, [push]),
        integrator=Rk4(1e-3),
    )
    assert run.status == "completed"
    assert run["distance.obstacle_clearance"].min() > 0.0
    assert run["task.it.error"][-1, 0] > 0.05  # the ball is in the way
    free = simulate(controller, [0.1], duration=0.6, control_period=1e-3)
    assert np.abs(run.v - free.v).max() > 0.1  # it was pushed
