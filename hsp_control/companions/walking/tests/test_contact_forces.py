"""Forces of contacts from the efforts that the model does not explain."""

from functools import cache

import numpy as np
import pytest

from hsp_control import Controller, JointPosture, load_experiment
from hsp_control.common.errors import EstimationError
from hsp_control.companions.walking import ContactForces
from hsp_control.constraints.contacts import PointContact
from hsp_control.control.measurement import Measurement
from hsp_control.simulation import simulate
from hsp_control.simulation.plants import RigidContact, RigidContacts

pytest.importorskip("example_robot_data")
CASES = {
    "whole_body/talos_circle": ("left_sole_link", "right_sole_link"),
    "whole_body/solo12_trunk": ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT"),
}


@cache
def standing(name):
    """Return half a second on rigid contacts, with all forces estimated, too."""
    experiment = load_experiment(name)
    kind = "surface" if "talos" in name else "point"
    contacts = [RigidContact(frame, kind=kind) for frame in CASES[name]]
    return simulate(
        experiment.controller,
        experiment.q0,
        duration=0.5,
        control_period=0.002,
        log_period=0.01,
        integrator=experiment.integrator,
        plant=RigidContacts(contacts),
        estimators=[ContactForces(bandwidth=200.0, instead=True)],
    )


@pytest.mark.parametrize("name", CASES)
def test_estimates_equal_forces_of_rigid_contacts(name):
    run = standing(name)
    weight = 9.81 * sum(
        inertia.mass for inertia in load_experiment(name).robot.model.inertias
    )
    later = run.t > 0.1  # the observer has converged
    for frame in CASES[name]:
        for part, share in (("force", 0.02), ("moment", 0.005)):
            if part == "moment" and "talos" not in name:
                continue  # a rigid point fixes the centre, a ball rolls below it
            true = run[f"plant.contact.{frame}.{part}"][later]
            found = run[f"estimate.contact.{frame}.{part}"][later]
            assert np.abs(true - found).max() < share * weight


@pytest.mark.parametrize("name", CASES)
def test_wrenches_that_push_on_a_robot_at_rest_are_found(name):
    """Any wrenches; the force on a ball acts at its contact, below the centre."""
    experiment, random = load_experiment(name), np.random.default_rng(1)
    robot, q, rest = experiment.robot, experiment.q0, np.zeros(experiment.robot.nv)
    state, tau = robot.state(0.0, q, rest), robot.inverse_dynamics(q, rest, rest)
    pushes = {}
    for contact in experiment.controller.contacts:
        wrench = random.normal(size=6)
        if contact.yaml_type == "ball":
            wrench[3:] = np.cross([0.0, 0.0, -contact.radius], wrench[:3])
        pushes[contact.frame] = wrench
        tau -= state.frame(contact.frame).jacobian.T @ wrench
    running = ContactForces(bandwidth=1e6).begin(experiment.controller, None)
    for k in range(2):
        out = running.update(Measurement(k, 0.01 * k, q, rest, applied=tau))
    for frame, wrench in pushes.items():
        assert out.wrenches[frame] == pytest.approx(wrench, abs=1e-8)


def test_a_wrench_that_moves_nothing_is_zero():
    """For two contacts at one place only the sum is observable; both get half."""
    experiment = load_experiment("whole_body/solo12_trunk")
    robot, q, rest = experiment.robot, experiment.q0, np.zeros(experiment.robot.nv)
    first = experiment.controller.contacts[0]
    one, two = (
        PointContact(first.frame, name="one"),
        PointContact(first.frame, name="two"),
    )
    state, tau = robot.state(0.0, q, rest), robot.inverse_dynamics(q, rest, rest)
    wrench = np.array([1.0, 2.0, 30.0, 0.0, 0.0, 0.0])
    tau -= state.frame(first.frame).jacobian.T @ wrench
    running = ContactForces(bandwidth=1e6).begin(
        Controller(robot, [], contacts=[one, two]), None
    )
    for k in range(2):
        out = running.update(Measurement(k, 0.01 * k, q, rest, applied=tau))
    assert out.wrenches[first.frame] == pytest.approx(0.5 * wrench, abs=1e-8)


@pytest.mark.parametrize("instead", [True, False])
def test_measured_wrenches_are_replaced_on_request(instead):
    experiment = load_experiment("whole_body/solo12_trunk")
    q, rest = experiment.q0, np.zeros(experiment.robot.nv)
    frames = [each.frame for each in experiment.controller.contacts]
    measured = np.full(6, 7.0)
    running = ContactForces(instead=instead).begin(experiment.controller, None)
    out = running.update(
        Measurement(0, 0.0, q, rest, applied=rest, wrenches={frames[0]: measured})
    )
    assert np.array_equal(out.wrenches[frames[0]], measured) != instead
    assert out.estimated == frozenset(frames if instead else frames[1:])


def test_a_robot_without_contacts_is_refused():
    robot = load_experiment("whole_body/solo12_trunk").robot
    flying = Controller(robot, [JointPosture(joints=["FL_HAA"])], base="flying")
    with pytest.raises(EstimationError, match="no contacts whose forces could be est"):
        ContactForces().begin(flying, None)
