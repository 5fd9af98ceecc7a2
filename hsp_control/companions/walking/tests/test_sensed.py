"""Contacts begin and end by measured forces."""

import numpy as np
import pytest

from hsp_control import load_experiment
from hsp_control.common.errors import HspControlError, PlanError
from hsp_control.companions.walking import Sensed, SensedContact
from hsp_control.companions.walking.contact_switch import Switch
from hsp_control.control.measurement import Measurement
from hsp_control.robot.integrators import Rk4
from hsp_control.simulation import simulate
from hsp_control.simulation.plants import RigidContact, RigidContacts

pytest.importorskip("example_robot_data")
SWING, FOOT = "whole_body/solo12_swing", "FL_FOOT"
UNSCHEDULED = ("contacts.front_left.schedule=null", "tasks.foot.schedule=null")


def reported(rule, *overrides):
    """Return the experiment of a foot with a sensed contact, and its run."""
    plan = f"plan={{type: sensed, contacts: {{front_left: {rule}}}}}"
    experiment = load_experiment(SWING, *UNSCHEDULED, plan, *overrides)
    return experiment, experiment.scenario.plan.begin(experiment.controller)


def feel(experiment, running, t, force):
    """Set a measured force; return the contact's and the task's switches."""
    q, v = experiment.q0, np.zeros(experiment.robot.nv)
    wrenches = {} if force is None else {FOOT: np.array([0, 0, force, 0, 0, 0.0])}
    running.update(Measurement(0, t, q, v, wrenches=wrenches))
    contacts = {each.name: each for each in experiment.controller.contacts}
    tasks = {each.name: each for each in experiment.controller.tasks}
    return contacts["front_left"].schedule, tasks["foot"].schedule


def test_it_carries_when_pressed_and_its_force_rises():
    experiment, running = reported("{force: 3, task: foot, ramp: 0.2}")
    contact, task = feel(experiment, running, 0.0, 0.0)
    assert isinstance(contact, Switch)
    assert not contact.is_on
    assert task.is_on
    contact, task = feel(experiment, running, 0.1, 2.9)
    assert not contact.active(0.1)
    contact, task = feel(experiment, running, 0.2, 3.0)
    assert contact.active(0.2)
    assert not task.active(0.2)
    assert contact.weight(0.2) == 0.0
    assert 0.0 < contact.weight(0.3) < contact.weight(0.4) == 1.0
    channels = running.log_channels()
    assert channels["plan.front_left.active"].value == 1.0
    assert channels["plan.front_left.force"].value == 3.0
    assert channels["plan.front_left.events"].value == 1.0


def test_it_ends_when_the_ground_is_gone_but_not_at_once():
    experiment, running = reported(
        "{force: 4, patience: 0.02, task: foot, starts: true}"
    )
    contact, task = feel(experiment, running, 0.0, 0.0)  # nothing is measured yet
    assert contact.is_on
    assert not task.is_on
    for k in range(1, 30):
        contact, task = feel(experiment, running, 0.001 * k, 1.1)
        assert contact.is_on
    for k in range(30, 50):
        contact, task = feel(experiment, running, 0.001 * k, 0.9)  # below a quarter
        assert contact.is_on, k
    contact, task = feel(experiment, running, 0.051, 0.9)
    assert not contact.is_on
    assert contact.weight(0.061) == pytest.approx(0.5)  # it fades for as long again
    assert task.weight(0.061) == 0.0
    assert not contact.active(0.0711)
    assert task.weight(0.0711) == 1.0


@pytest.mark.parametrize(
    ("height", "force", "carries"),
    [(0.02, 2.9, False), (0.01, 3.0, False), (0.02, 3.0, True)],
)
def test_with_height_and_force_both_must_be_felt(height, force, carries):
    experiment, running = reported(f"{{force: 3, height: {height}}}")
    contact, _ = feel(experiment, running, 0.0, force)  # standing height: 0.0165 m
    assert contact.is_on == carries


@pytest.mark.parametrize(("rule", "message"), [
    ("{}", "give force or height, by which it is detected"),
    ("{height: 0.1, release: 2}", "release is a force; give force, too"),
    ("{force: 2, release: 2}", "release is 2 N; must be below force = 2 N"),
    ("{force: 2, wanted: [[2, 1]]}", "the interval from 2 to 1 s is empty"),
    ("{force: 2, task: fot}", "no task 'fot'; did you mean 'foot'"),
])  # fmt: skip
def test_unsuitable_input_is_reported(rule, message):
    with pytest.raises(HspControlError, match=message):
        reported(rule)


def test_schedules_and_unknown_contacts_are_refused():
    sensed = Sensed([SensedContact(2.0, name="front_left")])
    experiment = load_experiment(SWING)
    scenario = experiment.scenario
    given = (*scenario.tasks.values(),), (*scenario.contacts.values(),)
    with pytest.raises(PlanError, match=r"plan.contacts.front_left: the contact has a"):
        sensed.parts(experiment.robot, *given)
    with pytest.raises(PlanError, match=r"no contact 'front_lft'; did you mean"):
        Sensed([SensedContact(2.0, name="front_lft")]).parts(experiment.robot, *given)


def stood(plant, *overrides, duration):
    """Return a run of Solo on rigid contacts; that of the front left foot is sensed."""
    experiment, _ = reported("{force: 2, starts: true, ramp: 0.05}", *overrides)
    return simulate(
        experiment.controller, experiment.q0, duration=duration,
        control_period=0.002, log_period=0.002, integrator=Rk4(step=0.002),
        plant=plant, plan=experiment.scenario.plan,
    )  # fmt: skip


def test_on_rigid_contacts_it_tracks_the_plant():
    """The plant's contact is lost and regained; the controller detects both."""
    feet = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
    plant = RigidContacts(
        [
            RigidContact(foot, kind="point", on=[[None, 0.1], [0.2, None]])
            if foot == FOOT
            else RigidContact(foot, kind="point")
            for foot in feet
        ]
    )
    run = stood(plant, duration=0.3)
    carries, t = run["plan.front_left.active"], run.t
    assert carries[t < 0.1].all()
    gone = t[np.flatnonzero(np.diff(carries) < 0)[0] + 1]
    assert 0.1 + 0.015 < gone < 0.1 + 0.03  # its patience
    back = t[np.flatnonzero(np.diff(carries) > 0)[0] + 1]
    assert 0.2 <= back < 0.29  # when it changes from a pull to a push
    weight = run["contact.front_left.weight"]
    assert weight[np.flatnonzero(t >= back + 0.05)] == pytest.approx(1.0)
    faded = gone + 0.02  # its patience again
    assert weight[(t > faded) & (t < back)] == pytest.approx(0.0)
    assert run["plan.front_left.force"][-1] > 2.0
