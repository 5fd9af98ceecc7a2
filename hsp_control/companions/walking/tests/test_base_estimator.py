"""The base of a whole robot: against the truth, and refusals."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Controller, load_experiment
from hsp_control.common.errors import (
    EstimationError,
    HspControlError,
    SimulationError,
)
from hsp_control.companions.walking import BaseEstimator
from hsp_control.companions.walking.estimation.invariant_filter import ROTATION
from hsp_control.control.measurement import Inertial
from hsp_control.control.plans import MotionPlan, RunningPlan
from hsp_control.simulation import simulate
from hsp_control.simulation.plants import Imu, RigidContact, RigidContacts

pytest.importorskip("example_robot_data")
SOLES = ("left_sole_link", "right_sole_link")
EXACT = Imu(
    "imu_link",
    gyroscope_noise=0.0,
    accelerometer_noise=0.0,
    gyroscope_walk=0.0,
    accelerometer_walk=0.0,
    gyroscope_bias=0.0,
    accelerometer_bias=0.0,
)


class Listening(RunningPlan):
    """Records its measurements."""

    def __init__(self):
        super().__init__(Listens())
        self.heard = []

    def start(self, state):
        pass

    def update(self, measured):
        wrenches = {name: each.copy() for name, each in measured.wrenches.items()}
        self.heard.append(measured._replace(wrenches=wrenches))

    def log_channels(self):
        return {}


class Listens(MotionPlan):
    """A plan that only receives measurements."""

    def parts(self, robot, tasks, contacts):
        raise NotImplementedError

    def begin(self, controller):
        return LISTENING


LISTENING = Listening()


@cache
def swaying():
    """Return a robot that sways on two rigid feet, and its measurements."""
    experiment = load_experiment(
        "whole_body/talos_circle", "tasks.center_of_mass.blend=0.3"
    )
    plant = RigidContacts([RigidContact(sole) for sole in SOLES], sensors=[EXACT])
    LISTENING.heard.clear()
    simulate(
        experiment.controller,
        experiment.q0,
        duration=1.0,
        control_period=0.002,
        log_period=0.1,
        integrator=experiment.integrator,
        plant=plant.build(experiment.robot, experiment.integrator),
        plan=Listens(),
    )
    return experiment, tuple(LISTENING.heard)


def tilted(robot, q, angles, velocity):
    """Return a configuration whose base is tilted, and a velocity."""
    wrong = np.zeros(robot.nv)
    wrong[3:6] = angles
    v = np.zeros(robot.nv)
    v[:3] = velocity
    return robot.integrate(q, wrong), v


def test_without_noise_it_converges_to_the_truth():
    experiment, heard = swaying()
    robot = experiment.robot
    sure = BaseEstimator(
        gyroscope_noise=1e-6, accelerometer_noise=1e-5, gyroscope_walk=1e-8,
        accelerometer_walk=1e-8, slip=1e-7, joint_noise=0.0, leg_noise=1e-4,
        start_tilt=0.05, start_velocity=0.1, start_gyroscope_bias=1e-3,
        start_accelerometer_bias=1e-3,
    )  # fmt: skip
    running = sure.begin(experiment.controller, heard[0].inertial)
    wrong_q, wrong_v = tilted(robot, heard[0].q, [0.04, -0.03, 0.0], [0.1, 0.05, 0.0])
    estimate = running.update(heard[0]._replace(q=wrong_q, v=heard[0].v + wrong_v))
    for each in heard[1:]:
        estimate = running.update(each)
    true = heard[-1]
    down = np.array([0.0, 0.0, 1.0])
    for name in ("base_link", *SOLES):
        hat = robot.state(0.0, estimate.q, estimate.v).frame(name)
        real = robot.state(0.0, true.q, true.v).frame(name)
        assert hat.rotation.T @ down == pytest.approx(real.rotation.T @ down, abs=2e-4)
    velocity = np.linalg.norm(estimate.v[:3] - true.v[:3])
    assert velocity < 1e-3
    assert estimate.v[3:6] == pytest.approx(true.v[3:6], abs=0.05)  # half a period late
    assert estimate.q[7:] == pytest.approx(true.q[7:])
    # The soles are at rest.
    P = running.filter.covariance
    assert np.sqrt(np.diag(P)[ROTATION][:2]).max() < 2e-4


def test_from_the_truth_it_stays_there():
    experiment, heard = swaying()
    running = BaseEstimator().begin(experiment.controller, heard[0].inertial)
    for each in heard:
        estimate = running.update(each)
        channels = running.log_channels(each.q, each.v)
        assert np.abs(channels["estimate.position_error"].value).max() < 1e-4
        assert np.abs(channels["estimate.rotation_error"].value).max() < 1e-4
        assert np.abs(channels["estimate.velocity_error"].value).max() < 2e-3
        assert channels["estimate.contacts"].value <= 2.0
    assert estimate.wrenches is heard[-1].wrenches
    R = experiment.robot.state(0.0, each.q, each.v).frame("base_link").rotation
    turned, _ = tilted(experiment.robot, each.q, 0.1 * R[2], np.zeros(3))
    error = running.log_channels(turned, each.v)["estimate.rotation_error"].value
    assert error == pytest.approx([0.0, 0.0, -0.1], abs=1e-3)


@pytest.mark.parametrize("share", [0.0, 0.09])
def test_a_foot_is_in_contact_while_it_is_pressed(share):
    """With a tenth of the robot's weight."""
    experiment, heard = swaying()
    mass = sum(inertia.mass for inertia in experiment.robot.model.inertias)
    running = BaseEstimator().begin(experiment.controller, heard[0].inertial)
    for each in heard[:10]:
        running.update(each)
    assert len(running.filter.names) == 8
    touch = np.array([0.0, 0.0, 9.81 * share * mass, 0.0, 0.0, 0.0])
    lifted = dict(heard[10].wrenches) | {SOLES[0]: touch}
    running.update(heard[10]._replace(wrenches=lifted))
    assert {name for name, _ in running.filter.names} == {"right_foot"}
    running.update(heard[11])
    assert len(running.filter.names) == 8


def test_only_the_named_contacts_are_used():
    experiment, heard = swaying()
    own = BaseEstimator(contacts=["left_foot"])
    running = own.begin(experiment.controller, heard[0].inertial)
    for each in heard[:5]:
        running.update(each)
    assert {name for name, _ in running.filter.names} == {"left_foot"}
    wrong = BaseEstimator(contacts=["left_fot"])
    with pytest.raises(EstimationError, match=r"no contact 'left_fot'; did you mean"):
        wrong.begin(experiment.controller, heard[0].inertial)


def test_without_a_force_the_controller_determines_the_stance_foot():
    experiment, heard = swaying()
    running = BaseEstimator().begin(experiment.controller, heard[0].inertial)
    running.update(heard[0]._replace(wrenches={}))
    assert len(running.filter.names) == 8


def test_unsuitable_input_is_reported():
    arm = load_experiment("paper/2_rest").controller
    reading = Inertial("base_link", np.zeros(3), np.zeros(3))
    with pytest.raises(EstimationError, match=r"has no free-flyer root at its beg"):
        BaseEstimator().begin(arm, reading)
    experiment, heard = swaying()
    with pytest.raises(EstimationError, match=r"no inertial measurement unit is there"):
        BaseEstimator().begin(experiment.controller, None)
    flying = Controller(experiment.robot, experiment.controller.tasks, base="flying")
    with pytest.raises(EstimationError, match="no contacts, from which the legs"):
        BaseEstimator().begin(flying, reading)
    running = BaseEstimator().begin(experiment.controller, heard[0].inertial)
    with pytest.raises(EstimationError, match=r"at t = 0.002 s .* reported nothing"):
        running.update(heard[1]._replace(inertial=None))
    with pytest.raises(SimulationError, match=r"estimators estimate once a period"):
        simulate(experiment.controller, experiment.q0, duration=0.1,
                 estimators=[BaseEstimator()])  # fmt: skip


def test_a_configuration_without_a_unit_is_refused_at_its_key():
    with pytest.raises(
        HspControlError, match=r"estimators.base: no inertial measurement un"
    ):
        load_experiment("whole_body/solo12_trunk", "estimators.base=true")
    with pytest.raises(HspControlError, match=r"imu.frame: no frame 'base_lnk'; did y"):
        load_experiment("whole_body/solo12_trunk", "plant.sensors={imu: base_lnk}")
