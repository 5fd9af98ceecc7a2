"""A crawl is a value, and refuses what a trot refuses, in its own words."""

import pytest

from hsp_control import Robot, load_experiment
from hsp_control.common.exceptions import HspControlError, PlanError
from hsp_control.companions.walking import Crawl
from hsp_control.constraints.contacts import BallContact, SurfaceContact

pytest.importorskip("example_robot_data")
CRAWL = "walking/solo12_trot"
NAMES = ("FL_FOOT", "FR_FOOT", "HL_FOOT", "HR_FOOT")
FEET = [BallContact(name, radius=0.0165) for name in NAMES]


@pytest.mark.parametrize(("contacts", "message"), [
    (FEET[:3], r"^plan: a quadruped crawls on four feet; there are 3 \(FL_FOOT"),
    ([*FEET[:3], SurfaceContact("HR_FOOT", length=0.1, width=0.1)],
     "^plan: contact 'HR_FOOT' is a surface; a quadruped crawls on feet of type"),
])  # fmt: skip
def test_what_does_not_fit_is_said(contacts, message):
    with pytest.raises(HspControlError, match=message):
        Crawl().parts(Robot.load("solo12"), [], contacts)


def test_an_arm_and_long_strides_are_refused():
    with pytest.raises(PlanError, match=r"^plan: panda cannot crawl: it has no free-f"):
        Crawl().parts(Robot.load("panda"), [], [])
    with pytest.raises(PlanError, match=r"a foot is 0.48 m before and .* Crawl slower"):
        load_experiment(CRAWL, "plan={type: crawl, speed: 0.3}")
