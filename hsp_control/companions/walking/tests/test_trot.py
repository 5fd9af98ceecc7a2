"""Trots and crawls are values; mistakes are refused before a foot swings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from wording import wording

from hsp_control import Limits, Robot, load_experiment
from hsp_control.common.errors import HspControlError, PlanError
from hsp_control.companions.walking import Crawl, Trot
from hsp_control.companions.walking.contact_switch import Switch
from hsp_control.companions.walking.footsteps import Velocity
from hsp_control.companions.walking.four_feet import PointFoot
from hsp_control.companions.walking.plan_composition import FRICTION
from hsp_control.companions.walking.quadruped import BANDWIDTH
from hsp_control.constraints.contacts import BallContact, SurfaceContact
from hsp_control.tasks import CenterOfMass
from hsp_control.trajectories import Hold, Stops

pytest.importorskip("example_robot_data")
TROT = "walking/solo12_trot"
FEET = [
    BallContact(frame, radius=0.0165)
    for frame in ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
]


@pytest.fixture(scope="module")
def solo() -> Robot:
    return Robot.load("solo12")


def test_it_adds_what_it_needs(solo):
    own = CenterOfMass(axes="xy", priority=3)
    made = Trot(speed=0.3).parts(solo, [own], FEET)
    tasks = {task.name: task for task in made.tasks}
    assert set(tasks) == {
        "center_of_mass", "height", "trunk", *(foot.frame for foot in FEET),
    }  # fmt: skip
    assert tasks["center_of_mass"].priority == 3
    assert tasks["center_of_mass"].trajectory.dimension == 2
    assert tasks["height"].trajectory.dimension == 1
    assert all(isinstance(each.schedule, Switch) for each in made.contacts)
    assert {each.friction for each in made.contacts} == {FRICTION}
    sure = Trot().parts(solo, [], [replace(foot, friction=0.9) for foot in FEET])
    assert {each.friction for each in sure.contacts} == {0.9}


TURNED = BallContact("HR_FOOT", radius=0.0165, normal=[1, 0, 0])


@pytest.mark.parametrize(("trot", "tasks", "contacts", "message"), [
    (Trot(), [], [], "plan: ... trots on four feet ... 0"),
    (Trot(), [], FEET[:3], "plan: ... trots on four feet ... 3 (FL"),
    (Crawl(), [], FEET[:3], "plan: ... crawls on four feet ... 3 (FL"),
    (Trot(feet=["FL_FOO"]), [], FEET, "... no ... 'FL_FOO' ... 'FL_FOOT'"),
    (Trot(), [], [*FEET[:3], SurfaceContact("HR_FOOT", length=0.1, width=0.1)],
     "plan: contact 'HR_FOOT' is a surface"),
    (Trot(), [CenterOfMass()], FEET, "tasks.center_of_mass: ... 'xyz' ... 'xy'"),
    (Trot(), [], [*FEET[:3], TURNED],
     "plan: contact 'HR_FOOT' ... normal [1.0, 0.0, 0.0]"),
])  # fmt: skip
def test_unsuitable_input_is_reported(solo, trot, tasks, contacts, message):
    with pytest.raises(HspControlError, match=wording(message)):
        trot.parts(solo, tasks, contacts)


def test_a_leg_needs_three_joints(solo):
    with pytest.raises(PlanError, match=r"^plan: the leg of 'FL_FOOT' has 2 joints"):
        Trot().parts(Robot.load("solo8"), [], FEET)
    trunk = BallContact("base_link", radius=0.0165)
    with pytest.raises(PlanError, match=r"^plan: the leg of 'base_link' has 0 joints"):
        Trot().parts(solo, [], [*FEET[:3], trunk])
    with pytest.raises(PlanError, match=r"^plan: panda cannot crawl: it has no free-f"):
        Crawl().parts(Robot.load("panda"), [], [])


def test_barriers_let_legs_swing():
    """A given value is kept, also through later changes."""
    controller = load_experiment(TROT).controller
    assert controller.limits.bandwidth == BANDWIDTH
    controller.at(0.1).ramp(0.0).limits(Limits(velocity=0.5))
    controller.compute(0.2, controller.robot.home(), np.zeros(controller.robot.nv))
    assert controller.limits.bandwidth == pytest.approx(BANDWIDTH, rel=1e-12)
    assert (
        load_experiment(TROT, "limits={bandwidth: 7}").controller.limits.bandwidth == 7
    )
    assert load_experiment(TROT, "limits=none").controller.limits is None


def test_infeasible_parts_are_reported_before_the_run():
    with pytest.raises(PlanError, match=r"plan: at 3 m/s a foot is 0.525 m before and"):
        load_experiment(TROT, "plan.speed=3")
    with pytest.raises(PlanError, match=r"at 0.3 m/s and 9 rad/s a foot is 0.374 m"):
        load_experiment(TROT, "plan.turn=9")
    with pytest.raises(PlanError, match=r"lift is 0.5 m, but the hip of 'front_left' "):
        load_experiment(TROT, "plan.lift=0.5")
    with pytest.raises(PlanError, match=r"a foot is 0.48 m before and .* Crawl slower"):
        load_experiment(TROT, "plan={type: crawl, speed: 0.3}")
    shared = "contacts.hind_right.frame=HL_FOOT"
    with pytest.raises(PlanError, match=r"plan: the feet do not stand at the four cor"):
        load_experiment(TROT, shared)


def test_the_velocity_may_change_and_ends():
    stops = Stops(waypoints=[[0, 0, 0], [0.2, 0, 0.1]], times=[1.0, 2.0])
    trot = Trot(velocity=stops, until=5.0)
    assert trot.velocity_at(3.0) == (0.2, 0.0, 0.1)
    assert trot.velocity_at(5.0).is_zero
    with pytest.raises(PlanError, match=r"give either velocity or speed, not both"):
        replace(trot, speed=0.2)
    with pytest.raises(PlanError, match=r"velocity has dimension 1; needs 3"):
        Trot(velocity=Hold([0.1]))
    with pytest.raises(PlanError, match=r"contact_force is 0.25 robot weights; must"):
        Trot(contact_force=0.25)


def test_the_body_turns_about_its_middle_above_a_foot():
    """v + ω × r: on one side a turn adds to the way, on the other it subtracts."""
    forward, left, turn = 0.3, -0.1, 0.5
    for x, y in ((0.2, 0.1), (0.2, -0.1), (-0.2, 0.1), (-0.2, -0.1)):
        foot = SimpleNamespace(offset=np.array([x, y]))
        way = np.array([forward, left, 0.0]) + np.cross([0.0, 0.0, turn], [x, y, 0.0])
        found = PointFoot.speed(foot, Velocity(forward, left, turn))
        assert found == pytest.approx(np.linalg.norm(way), rel=1e-12)
