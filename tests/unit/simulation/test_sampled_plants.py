"""Sampled plants, which advance from one control period to the next."""

from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from closed_loops import load, planar_controller, planar_start
from compensators import ALONE

from hsp_control import Robot, RobotState, Rollout, simulate
from hsp_control.common.arrays import Array
from hsp_control.common.errors import SimulationError
from hsp_control.control.measurement import LogChannel
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation.plants import IntegratedPlant, Plant, RigidBodyPlant
from hsp_control.simulation.plants.plant import FloatingRoots


class Sampled(IntegratedPlant):
    """A sampled plant that records its calls, and reports v + 1."""

    def __init__(self, robot: Robot, offset: float) -> None:
        super().__init__(RigidBodyPlant(robot), Rk4(0.001))
        self.offset = offset
        self.calls: list[tuple[Any, ...]] = []

    def reset(self, t: float, q: Array, v: Array) -> None:
        self.calls.append(("reset", t))
        super().reset(t, q, v)

    def measure(self, t: float, q: Array, v: Array) -> tuple[Array, Array]:
        self.calls.append(("measure", t))
        return (q, v + self.offset) if self.offset else (q, v)

    def advance(self, t: float, end: float, tau: Array) -> tuple[Array, Array]:
        self.calls.append(("advance", t, end, tau.copy()))
        return super().advance(t, end, tau)

    def log_channels(
        self, t: float, q: Array, v: Array, tau: Array
    ) -> dict[str, LogChannel]:
        return {"contact.tip.force": LogChannel(np.array([t, v[0], tau[0]]), "N", "so")}

    def describe(self) -> dict[str, Any]:
        return {"type": "Sampled", "offset": self.offset}


def run_sampled(plant: Plant | None) -> Rollout:
    return simulate(
        planar_controller(),
        planar_start(),
        [0.1, 0.2, 0.3],
        duration=0.04,
        control_period=0.005,
        integrator=Rk4(0.001),
        plant=plant,
        compensation=ALONE,
        start_time=1.0,
    )


def test_a_sampled_plant_is_reset_once_then_measured_and_moved_every_period() -> None:
    plant = Sampled(planar_controller().robot, 0.0)
    run = run_sampled(plant)
    kinds = [call[0] for call in plant.calls]
    assert kinds == ["reset", *["measure", "advance"] * 8, "measure"]
    assert plant.calls[0] == ("reset", 1.0)
    times = [call[1] for call in plant.calls if call[0] == "measure"]
    np.testing.assert_allclose(times, 1.0 + 0.005 * np.arange(9), rtol=0, atol=1e-12)
    for call in (call for call in plant.calls if call[0] == "advance"):
        assert call[2] - call[1] == pytest.approx(0.005, abs=1e-12)
    same = run_sampled(None)
    for name in same.columns:
        np.testing.assert_array_equal(run[name], same[name], err_msg=name)


def test_the_log_has_the_truth_and_the_effort_at_the_measured_state() -> None:
    """The logged effort is that at the measured v + 1; logged q, v are true."""
    controller = planar_controller()
    plant = Sampled(controller.robot, 1.0)
    run = run_sampled(plant)
    state = RobotState(controller.robot)
    for t, q, v, tau, error_rate in zip(
        run.t, run.q, run.v, run.tau, run["task.tip.error_rate"], strict=True
    ):
        expected = controller.compute(state.update(t, q, v + 1.0)).tau
        np.testing.assert_allclose(tau, expected, rtol=1e-12, atol=1e-12)
        truth = controller.compute(state.update(t, q, v)).task.error_rate
        np.testing.assert_allclose(error_rate, truth, rtol=1e-12, atol=1e-12)
    np.testing.assert_array_equal(
        run["contact.tip.force"], np.c_[run.t, run.v[:, 0], run.tau[:, 0]]
    )
    assert run.meta["columns"]["contact.tip.force"] == {"unit": "N", "meaning": "so"}
    assert run.meta["plant"] == {"type": "Sampled", "offset": 1.0}
    ideal = {"type": "RigidBodyPlant", "pushes": []}
    assert run_sampled(None).meta["plant"] == ideal


def test_a_sampled_plant_needs_a_control_period() -> None:
    plant = Sampled(planar_controller().robot, 0.0)
    with pytest.raises(
        SimulationError, match=r"^Sampled holds the effort .* control_p"
    ):
        simulate(planar_controller(), planar_start(), duration=0.1, plant=plant)


def test_a_plant_with_other_joints_is_refused() -> None:
    plant = RigidBodyPlant(load("panda"))
    message = r"^the plant moves panda with the joints panda_joint1, .* planar3r has "
    with pytest.raises(SimulationError, match=message):
        simulate(planar_controller(), planar_start(), duration=0.1, plant=plant)


def test_no_root_of_two_floating_robots_has_a_motor() -> None:
    """The second one begins at another index in q than in v."""
    model = pin.Model()
    for k in range(2):
        root = model.addJoint(0, pin.JointModelFreeFlyer(), pin.SE3.Identity(), f"b{k}")
        leg = model.addJoint(root, pin.JointModelRX(), pin.SE3.Identity(), f"leg{k}")
        for joint in (root, leg):
            body = pin.Inertia.FromBox(1.0, 0.3, 0.2, 0.1)
            model.appendBodyToJoint(joint, body, pin.SE3.Identity())
        model.addBodyFrame(f"trunk{k}", root, pin.SE3.Identity(), 0)
    roots = FloatingRoots(Robot.from_pinocchio(model))
    motors = np.zeros(14)
    motors[[6, 13]] = 2.0, 3.0  # of the legs
    np.testing.assert_array_equal(roots.remove_effort(0.0, motors), motors)
    for dof in {*range(14)} - {6, 13}:
        pushed = motors.copy()
        pushed[dof] = 1.0
        with pytest.raises(SimulationError, match="the root has no motor"):
            roots.remove_effort(0.0, pushed)
