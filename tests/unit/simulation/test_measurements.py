"""A plan's measurements, once per period: forces obey the momentum balance."""

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.common.errors import FallError, SimulationError
from hsp_control.control.compensation import CompensatedController
from hsp_control.control.measurement import Measurement
from hsp_control.control.plans import MotionPlan, PlanParts, RunningPlan
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation import simulate
from hsp_control.simulation.control_chain import ControlChain
from hsp_control.simulation.loops import sampled_loop
from hsp_control.simulation.plants import IntegratedPlant, RigidContact, RigidContacts

pytest.importorskip("example_robot_data")
FEET = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")


class Listening(RunningPlan):
    """Stores its measurements; reports a fall at a given time."""

    def __init__(self, falls_at: float = np.inf) -> None:
        super().__init__(Falls())
        self.heard: list[Measurement] = []
        self.falls_at = falls_at

    def start(self, state):
        pass

    def update(self, measured):
        self.heard.append(measured._replace(wrenches=dict(measured.wrenches)))
        if measured.t >= self.falls_at:
            raise FallError(f"the robot falls: at t = {measured.t:.3f} s")

    def log_channels(self):
        return {}


class Falls(MotionPlan):
    """A plan that only reports a fall."""

    def parts(self, robot, tasks, contacts):
        return PlanParts(tuple(tasks), tuple(contacts))

    def begin(self, controller):
        return Listening(falls_at=0.02)


class Listens(Falls):
    """A plan that only receives measurements."""

    def begin(self, controller):
        return Listening()


def momentum_balance(plant, tolerance):
    """Assert m c'' = Σ F - m g, with c'' from one period to the next."""
    experiment = load_experiment("whole_body/solo12_trunk")
    robot, h = experiment.robot, 0.001
    times = np.arange(60) * h
    chain = ControlChain(CompensatedController(experiment.controller), Listens())
    chain.begin(None)
    plan = chain.plan
    for _ in sampled_loop(chain, plant, 1, times, experiment.q0, experiment.v0):
        pass
    mass = sum(inertia.mass for inertia in robot.model.inertias)
    rates = [
        robot.state(each.t, each.q, each.v).centroidal.velocity.copy()
        for each in plan.heard
    ]
    assert [each.t for each in plan.heard] == pytest.approx(times)
    for k in range(20, 59):
        total = sum(plan.heard[k].wrenches[foot][:3] for foot in FEET)
        acceleration = (rates[k] - rates[k - 1]) / h
        missing = total - mass * (acceleration + np.array([0.0, 0.0, 9.81]))
        assert np.abs(missing).max() < tolerance * mass * 9.81
    return plan


def test_mujoco_measures_the_forces_of_the_period_that_ends():
    pytest.importorskip("hsp_control.companions.mujoco")
    plan = momentum_balance(load_experiment("whole_body/solo12_trunk").plant, 1e-5)
    up = np.array([0.0, 0.0, 1.0])
    last = plan.heard[-1]
    assert last.normal_force(FEET[0], up) == last.wrenches[FEET[0]][2] > 3.0
    assert last.normal_force("base_link", up) is None
    assert not any(wrench.any() for wrench in plan.heard[0].wrenches.values())


def test_rigid_contacts_measure_them_too():
    robot = load_experiment("whole_body/solo12_trunk").robot
    part = RigidContacts([RigidContact(foot, kind="point") for foot in FEET])
    rk4 = Rk4(step=0.001)
    plant = part.build(robot, rk4)
    # The force is that at the end of a period, the balance holds for its mean.
    momentum_balance(IntegratedPlant(plant, rk4), 2e-3)


def test_a_fall_is_reported_and_stops_the_run():
    experiment = load_experiment("paper/2_rest")
    given = (experiment.controller, experiment.q0)
    run = simulate(*given, duration=0.1, control_period=0.001, plan=Falls())
    assert run.status == "stopped"
    assert run.meta["message"] == "the robot falls: at t = 0.020 s"
    assert run.t[-1] <= 0.02
    with pytest.raises(SimulationError, match="a plan decides once a period"):
        simulate(*given, duration=0.1, plan=Falls())
