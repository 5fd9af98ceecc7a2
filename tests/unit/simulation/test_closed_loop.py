"""The closed loop: sampled and continuous control, time, and progress."""

from typing import Any

import numpy as np
import pytest
from closed_loops import EXACT, order, panda_controller, planar_controller, planar_start

from hsp_control import Controller, FramePosition, Gains, Robot, simulate
from hsp_control.common.arrays import Array
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import RigidBodyPlant
from hsp_control.trajectories import Lissajous


@pytest.mark.parametrize("which", ["planar3r", "panda"])
def test_sampled_control_converges_in_first_order(which: str) -> None:
    """Held efforts deviate from the continuous law in proportion to the period.

    Slopes by regression over 8, 4, 2 and 1 ms; measured: 1.01 to 1.04.
    """
    controller = planar_controller() if which == "planar3r" else panda_controller()
    robot = controller.robot
    q0 = planar_start() if which == "planar3r" else robot.home()
    options: Any = {"duration": 0.32, "log_period": 0.08}
    exact = simulate(controller, q0, integrator=EXACT, **options)
    periods = np.array([8e-3, 4e-3, 2e-3, 1e-3])
    deviations = []
    for period in periods:
        run = simulate(
            controller, q0, control_period=period, integrator=Rk4(4e-3), **options
        )
        deviations.append(
            [
                np.abs(run["joint_positions"] - exact["joint_positions"]).max(),
                np.abs(run.v - exact.v).max(),
                np.abs(run["null_space_error"] - exact["null_space_error"]).max(),
            ]
        )
    for column in np.array(deviations).T:
        assert order(periods, list(column)) == pytest.approx(1.0, abs=0.1)


class Spy(RigidBodyPlant):
    """A plant that records its calls."""

    def __init__(self, robot: Robot) -> None:
        super().__init__(robot)
        self.calls: list[tuple[float, Array]] = []

    def acceleration(self, t: float, q: Array, v: Array, tau: Array) -> Array:
        self.calls.append((t, tau.copy()))
        return super().acceleration(t, q, v, tau)


def test_sampled_control_holds_the_effort() -> None:
    """One effort per period from beginning to end; the first one is logged."""
    plant = Spy(planar_controller().robot)
    run = simulate(
        planar_controller(),
        planar_start(),
        duration=0.04,
        log_period=0.01,
        control_period=0.0025,
        integrator=Rk4(0.001),
        plant=plant,
    )
    times = np.array([t for t, _ in plant.calls])
    efforts = np.array([tau for _, tau in plant.calls])
    changes = 1 + np.flatnonzero(np.abs(np.diff(efforts, axis=0)).max(axis=1) > 0.0)
    np.testing.assert_allclose(
        times[[0, *changes]], 0.0025 * np.arange(16), rtol=0, atol=1e-12
    )
    assert len(plant.calls) == 16 * 3 * 4  # 3 steps of 0.83 ms, 4 stages
    np.testing.assert_array_equal(efforts[[0, *changes]][::4], run.tau[:4])


def test_continuous_control_is_evaluated_in_every_stage() -> None:
    plant = Spy(planar_controller().robot)
    simulate(
        planar_controller(),
        planar_start(),
        duration=0.02,
        integrator=Rk4(0.01),
        plant=plant,
    )
    efforts = np.array([tau for _, tau in plant.calls])
    assert len(efforts) == 8
    assert len(np.unique(efforts, axis=0)) == 8


def test_the_plant_may_be_another_robot() -> None:
    """A task error that decays on the model persists on an arm under gravity."""
    pytest.importorskip("example_robot_data")
    model, real = Robot.load("ur5"), Robot.load("ur5", gravity=(0.0, 0.0, -9.0))
    q0 = model.random_configuration(np.random.default_rng(1))
    x = model.state(0.0, q0, np.zeros(6)).position("tool0").copy()
    circle = Lissajous([0.02, 0.02, 0.02], [1.0, 1.0, 1.0], center=x)
    task = FramePosition("tool0", circle, gains=Gains(natural_frequency=10.0))
    controller = Controller(model, [task])
    runs = [
        simulate(controller, q0, duration=1.0, log_period=0.1, plant=plant)
        for plant in (None, RigidBodyPlant(real))
    ]
    ends = [np.abs(run["task.tool0.error"][-1]).max() for run in runs]
    assert ends[0] < 1e-3
    assert ends[1] > 3e-3
