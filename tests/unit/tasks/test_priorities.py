"""Default priorities: on a floating base, balance comes first."""

from typing import Any

import pytest
from loaded_robots import load
from task_cases import placed

from hsp_control import (
    CenterOfMass,
    Controller,
    FrameOrientation,
    FramePose,
    FramePosition,
    JointPosture,
    Pointing,
    Robot,
    Task,
)
from hsp_control.control.fitting import priority_of
from hsp_control.tasks import AngularMomentum, RelativePose

UP = (0.0, 0.0, 1.0)


@pytest.fixture(scope="module")
def quadruped() -> Robot:
    return load("solo12")


def every_task(trunk: str, foot: str) -> dict[str, tuple[Task, bool]]:
    """Return tasks, and whether the balance needs them."""
    made: dict[str, tuple[Task, bool]] = {
        "mass": (CenterOfMass(), True),
        "mass on an axis": (CenterOfMass(axes="x"), True),
        "momentum": (AngularMomentum(), True),
        "posture": (JointPosture(), False),
        "one joint": (JointPosture(joints=["FL_KFE"]), False),
        "foot from trunk": (RelativePose(foot, reference=trunk), False),
        "trunk from foot": (RelativePose(trunk, reference=foot), False),
    }
    for name, frame, needed in (("trunk", trunk, True), ("foot", foot, False)):
        for kind in (FramePose, FramePosition, FrameOrientation):
            made[f"{kind.__name__} of the {name}"] = kind(frame), needed
        made[f"pointing of the {name}"] = Pointing(frame, UP), needed
    return made


CASES = every_task("base_link", "FL_FOOT")


@pytest.mark.parametrize("which", CASES)
def test_on_a_floating_base_balance_comes_first(which: str, quadruped: Robot) -> None:
    task, needed = CASES[which]
    task = placed(task, quadruped)
    assert task.keeps_balance(quadruped) is needed
    assert priority_of(task, quadruped) == (1 if needed else 2)


@pytest.mark.parametrize(
    ("name", "root"), [("panda", None), ("ur5", "planar"), ("tiago_no_hand", None)]
)
def test_without_a_floating_base_all_tasks_have_the_first(name: str, root: Any) -> None:
    """A wheeled base is actuated and cannot fall."""
    robot = load(name, root)
    links = (robot.end_effector, robot.frame_names[-1])
    tasks: list[Task] = [
        CenterOfMass(),
        AngularMomentum(),
        JointPosture(),
        *(FramePosition(frame) for frame in links),
        *(Pointing(frame, UP) for frame in links),
    ]
    for task in tasks:
        assert priority_of(placed(task, robot), robot) == 1
    given = placed(FramePosition(priority=3), robot)
    assert priority_of(given, robot) == 3


def test_a_controller_s_levels(quadruped: Robot) -> None:
    tasks = [
        JointPosture(joints=["FL_KFE", "FR_KFE"], priority=5),
        FramePosition("FL_FOOT"),
        FrameOrientation("base_link"),
        FramePosition("FR_FOOT", priority=1),
        CenterOfMass(),
    ]
    controller = Controller(quadruped, tasks, base="driven")
    names = [[task.name for task in level] for level in controller.levels]
    assert names == [
        ["base_link_orientation", "FR_FOOT", "center_of_mass"],
        ["FL_FOOT"],
        ["posture"],
    ]
    found = {task.name: priority_of(task, quadruped) for task in controller.tasks}
    for name, priority in (("FR_FOOT", 1), ("FL_FOOT", 2), ("posture", 5)):
        assert found[name] == priority
    # The placed tasks have the user's values only.
    given = {task.name: task.priority for task in controller.tasks}
    assert given == {task.name: task.priority for task in tasks}
