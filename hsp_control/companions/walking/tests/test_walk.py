"""A walk is a value; an unsuitable robot is refused before the first step."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from wording import wording

from hsp_control import Controller, FramePose, Gains, Robot, load_experiment
from hsp_control.common.errors import FallError, HspControlError, PlanError
from hsp_control.companions.walking import Walk
from hsp_control.companions.walking.contact_switch import Switch
from hsp_control.companions.walking.foot import Foot
from hsp_control.constraints.contacts import BallContact, SurfaceContact
from hsp_control.control.falling import FallDetector
from hsp_control.tasks import CenterOfMass
from hsp_control.trajectories import Hold, Schedule, Stops

pytest.importorskip("example_robot_data")
WALK = "walking/talos_walk"
SOLE = {"length": 0.16, "width": 0.1}
FEET = [
    SurfaceContact(f"{side}_sole_link", name=f"{side}_foot", **SOLE)
    for side in ("left", "right")
]


@pytest.fixture(scope="module")
def talos() -> Robot:
    return load_experiment(WALK).robot


def test_it_adds_what_it_needs_and_keeps_what_is_given(talos):
    own = FramePose(
        "left_sole_link", gains=Gains(natural_frequency=33.0), name="left_foot"
    )
    made = Walk(speed=0.3).parts(talos, [own], FEET)
    tasks = {task.name: task for task in made.tasks}
    assert set(tasks) == {"center_of_mass", "trunk", "left_foot", "right_foot"}
    assert tasks["left_foot"].gains == own.gains
    assert isinstance(tasks["left_foot"].schedule, Switch)
    assert tasks["trunk"].frame == "base_link"
    assert [contact.name for contact in made.contacts] == ["left_foot", "right_foot"]
    assert all(isinstance(contact.schedule, Switch) for contact in made.contacts)


@pytest.mark.parametrize(
    ("walk", "tasks", "contacts", "message"),
    [
        (Walk(), [], [], "plan: ... walks on two feet ... 0"),
        (Walk(), [], FEET[:1], "plan: ... walks on two feet ... 1 (left"),
        (
            Walk(),
            [],
            [*FEET, SurfaceContact("base_link", name="seat", **SOLE)],
            "... 3 ( ... feet",
        ),
        (Walk(feet=["left_foot", "rigt"]), [], FEET, "... no contact 'rigt'"),
        (
            Walk(),
            [],
            [FEET[0], BallContact("right_sole_link", radius=0.1)],
            "plan: contact 'right_sole_link' is a ball",
        ),
        (
            Walk(),
            [],
            [FEET[0], replace(FEET[1], schedule=Schedule([(0, 9)]))],
            "contacts.right_foot: ... schedule ... plan",
        ),
        (
            Walk(),
            [CenterOfMass(name="trunk")],
            FEET,
            "tasks.trunk: ... center_of_mass ... frame_orientation",
        ),
        (
            Walk(),
            [FramePose("base_link", name="left_foot")],
            FEET,
            "tasks.left_foot: ... 'base_link' ... 'left_sole_link'",
        ),
        (
            Walk(),
            [CenterOfMass(schedule=Schedule([(0, 9)]))],
            FEET,
            "tasks.center_of_mass: ... schedule ... plan",
        ),
        (Walk(trunk="base_lnk"), [], FEET, "plan.trunk: no ... 'base_lnk'"),
    ],
)  # fmt: skip
def test_unsuitable_input_is_reported(talos, walk, tasks, contacts, message):
    with pytest.raises(HspControlError, match=wording(message)):
        walk.parts(talos, tasks, contacts)


def test_a_leg_of_five_joints_cannot_walk(talos):
    """Like that of Unitree's H1, or of Talos without its ankle-roll joint."""
    locked = {"leg_left_6_joint": 0.0}
    robot = Robot.load("talos", locked=locked)
    with pytest.raises(
        PlanError, match=r"^plan: the leg of 'left_foot' has 5 joints; a sole that is"
    ):
        Walk().parts(robot, [], FEET)


def test_an_arm_cannot_walk():
    with pytest.raises(
        PlanError, match=r"^plan: panda cannot walk: it has no free-fly"
    ):
        Walk().parts(Robot.load("panda"), [], [])


def test_a_velocity_is_given_once_and_has_three_numbers():
    with pytest.raises(
        PlanError, match=r"^Walk: give either velocity or turn, not both$"
    ):
        Walk(turn=0.1, velocity=Hold([0.1, 0.0, 0.0]))
    with pytest.raises(PlanError, match=r"^Walk: velocity has dimension 2; needs 3"):
        Walk(velocity=Hold([0.1, 0.0]))
    stops = Stops(waypoints=[[0, 0, 0], [0.2, 0, 0.1]], times=[1.0, 2.0])
    assert Walk(velocity=stops).velocity_at(3.0) == (0.2, 0.0, 0.1)


@pytest.mark.parametrize(("overrides", "message"), [
    (["plan.speed=1.2"], "... talos_walk.yaml:12: plan: 1.2 m/s ... 0.9 m ... 0.715 m"),
    (["plan.crouch=0.9"], "... plan: crouch is 0.9 m ... 0.877"),
    (["start.joints={leg_left_5_joint: -0.5}"],
     "... plan: ... 'left_foot' ... flat ground"),
    (["contacts.left_foot.width=0.2", "contacts.right_foot.width=0.2"],
     "... plan: ... 'left_foot' and 'right_foot' ... 0.17 m ... 0.2 m"),
])  # fmt: skip
def test_infeasible_parts_are_reported_before_the_run(overrides, message):
    with pytest.raises(HspControlError) as caught:
        load_experiment(WALK, *overrides)
    assert re.search(wording(message), str(caught.value))


def test_falls_are_found(talos):
    q = talos.home()
    start = talos.state(0.0, q, np.zeros(talos.nv))
    feet = ("left_sole_link", "right_sole_link")
    detector = FallDetector("base_link", feet, start)
    detector.check(start)

    def moved(step):
        return talos.state(3.2, talos.integrate(q, step), np.zeros(talos.nv))

    tilted, step = 0.9, np.zeros(talos.nv)
    step[4] = tilted
    with pytest.raises(FallError, match=r"t = 3.200 s base_link is tilted by 52° \(at"):
        detector.check(moved(step))
    step[4] = 0.7
    detector.check(moved(step))
    step[4] = tilted  # the tilt is measured from the start
    leaning = moved(step)
    FallDetector("base_link", feet, leaning).check(leaning)
    knees = np.zeros(talos.nv)
    for side in ("left", "right"):
        detector.check(moved(knees))  # it stands on one leg, above the lower foot
        for joint, angle in ((3, -1.2), (4, 2.2), (5, -1.0)):
            knees[talos.velocity_index(f"leg_{side}_{joint}_joint")] = angle
    with pytest.raises(FallError, match=r"its centre of mass is at \d+ % of its first"):
        detector.check(moved(knees))


def test_a_footstep_is_the_middle_of_a_sole(talos):
    """For any origin of the frame, also off the sole, as on a narrow ankle."""
    frame = SurfaceContact("left_sole_link", **SOLE, center=[0.02, 0.01, 0.0])
    given = {"left_foot": replace(frame, name="left_foot"), "right_foot": FEET[1]}
    made = Walk().parts(talos, [], list(given.values()))
    controller = Controller(talos, made.tasks, contacts=made.contacts)
    foot, turned = Foot("left_foot", controller), np.zeros(talos.nv)
    turned[5] = 0.6
    q = talos.integrate(talos.home(), turned)
    foot.begin(talos.state(0.0, q, np.zeros(talos.nv)), 0.6)
    assert foot.corners(1.0).mean(axis=0) == pytest.approx(foot.place.point)
    origin = foot.origin_of(foot.place)
    state = talos.state(0.0, q, np.zeros(talos.nv))
    assert origin.point == pytest.approx(state.position("left_sole_link")[:2])


GIVEN = "plan={type: walk, footsteps: %s}"


def test_footsteps_are_taken_from_the_middle_between_the_feet():
    rows = [[0.2, 0.085, 0.0], [0.4, -0.085, 0.2], [0.4, 0.085, 0.2]]
    experiment = load_experiment(WALK, GIVEN % rows)
    running = experiment.scenario.plan.begin(experiment.controller)
    running.start(experiment.robot.state(0.0, experiment.q0, experiment.v0))
    planner, places = running._planner, running._places
    assert planner.first_side(0.0, 0) == 1.0
    assert planner.sets_out(0.0, 2)
    assert not planner.sets_out(0.0, 3)
    middle = running._middle()
    point = places[1.0].point
    given = (0.0, 0, running._now, 1.0, places, 0.5, point, running._lead)
    preview = planner.look_ahead(*given)
    assert preview.target.point - middle == pytest.approx([0.2, 0.085], abs=1e-6)
    assert preview.swings.count(True) == 3
    for before, after in pairwise(preview.phases):
        assert np.array_equal(after.start, before.end)
    # Finally the weight is between the last two footsteps.
    assert preview.phases[-1].end - middle == pytest.approx([0.4, 0.0], abs=1e-6)


@pytest.mark.parametrize(("rows", "message"), [
    ("[[0.2, 0.085, 0], [1.2, -0.085, 0]]", "... footsteps[1] is 1 m ... 0.17 m"),
    ("[[0.2, -0.085, 0]]", "... footsteps[0] is 0.2 m ... 0"),
    ("[[0.2, 0.085]]", "... footsteps"),
    ("[[0.2, 0.085, 0]], speed: 0.2", "... either footsteps or speed"),
])  # fmt: skip
def test_footsteps_out_of_reach_are_reported(rows, message):
    with pytest.raises(HspControlError, match=wording(message)):
        load_experiment(WALK, GIVEN % rows)


@pytest.mark.parametrize("name", ["walking/talos_walk", "walking/solo12_trot"])
def test_in_a_new_run_a_robot_stands_on_all_its_feet(name):
    experiment = load_experiment(name)
    law, plan = experiment.controller, experiment.scenario.plan
    state = law.robot.state(0.0, experiment.q0, experiment.v0)
    feet = {each.name: each.schedule for each in law.contacts}
    swings = [each.schedule for each in law.tasks if each.name in feet]
    assert len(swings) == len(feet)
    for _ in range(2):
        plan.begin(law).start(state)
        assert all(each.is_on for each in feet.values())
        assert not any(each.is_on for each in swings)
        for contact, task in zip(feet.values(), swings, strict=True):
            contact.set(False, 1.0)
            task.set(True, 1.0)
