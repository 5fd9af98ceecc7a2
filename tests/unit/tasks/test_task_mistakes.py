"""Wrong arguments of tasks are refused by name; default names of tasks."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from loaded_robots import load, panda
from task_cases import TOOL, placed, planar
from wording import wording

from hsp_control import (
    CenterOfMass,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Pointing,
)
from hsp_control.common.errors import (
    ConfigurationError,
    FrameNotFoundError,
    GainError,
    HspControlError,
    JointNotFoundError,
    TaskError,
    TrajectoryError,
)
from hsp_control.tasks import AngularMomentum, RelativePose
from hsp_control.trajectories import CallableTrajectory, HoldOrientation, HoldPose


def posture(**options: Any) -> JointPosture:
    return JointPosture("home", **options)


def here() -> Any:
    return panda().state(0.0, panda().home(), np.zeros(7))


POSE = HoldPose(np.zeros(3), np.eye(3))
HOLD = HoldOrientation(np.eye(3))
POINT = Hold([0, 0, 0])
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    "reference of a relative pose": (
     lambda: placed(RelativePose(reference="panda_tpc"), panda()), FrameNotFoundError,
     "reference: no ... 'panda_tpc' ... 'panda_tcp'"),
    "a frame relative to itself": (
     lambda: placed(RelativePose(reference="panda_tcp"), panda()), TaskError,
     "reference: ... 'panda_tcp' ... different"),
    "dimension of a path in Python": (
     lambda: placed(CenterOfMass(CallableTrajectory(np.sin, 2)), panda()), TaskError,
     "trajectory: ... dimension 2 ... 3"),
    "more rows than dofs": (lambda: placed(FramePose("tip", POSE), planar()),
     TaskError, "the task has 6 rows ... 3 degrees"),
    "parts of the largest error": (
     lambda: placed(FramePose("panda_tcp", POSE, largest_error=[0.1] * 3), panda()),
     TaskError, "largest_error: ... 3 ... position [m] ... orientation [rad]"),
    "both direction and trajectory": (
     lambda: Pointing("panda_tcp", TOOL, trajectory=HOLD), TaskError,
     "Pointing: ... direction and trajectory"),
    "joint": (lambda: placed(posture(joints=["panda_joint8"]), panda()),
     JointNotFoundError,
     "joints: no ... 'panda_joint8' ... 'panda_joint"),
    "root": (lambda: placed(posture(joints=["root_joint"]), load("ur5", "planar")),
     TaskError,
     "joints: ... 'root_joint' ... 3 degrees"),
    "no joints": (lambda: placed(posture(joints=[]), panda()), TaskError,
     "joints: there is no joint"),
    "twice the same joint": (
     lambda: placed(posture(joints=["panda_joint1", "panda_joint1"]), panda()),
     TaskError, "joints: ... 'panda_joint1' ... twice"),
    "dimension of a displacement in Python": (
     lambda: placed(posture(displacement=CallableTrajectory(np.sin, 2)), panda()),
     TaskError,
     "displacement: ... 7 joints ... dimension 2"),
    "no configuration": (
     lambda: placed(JointPosture([1.0, 0.0, 1.0, 0.0, 0.6, 0.7]), planar()),
     ConfigurationError, "reference:"),
    "gains without decay": (
     lambda: placed(CenterOfMass(gains=Gains(1 + 3 * np.ones((3, 3)), 1)), panda()),
     GainError, "gains: ... does not decay"),
    "a frame that only the robot knows": (
     lambda: FramePosition(trajectory=POINT).evaluate(here()), TaskError,
     "task 'end_effector': ... frame"),
    "a frame that only the robot knows, in another's axes": (
     lambda: RelativePose(reference="panda_link0").evaluate(here()), TaskError,
     "task 'end_effector_from_panda_link0': ... frame"),
    "an orientation that only the start knows": (
     lambda: FramePose("panda_tcp", POINT).evaluate(here()), TaskError,
     "task 'panda_tcp': ... orientation"),
    "a point that only the start knows": (
     lambda: FramePosition("panda_tcp").evaluate(here()), TrajectoryError,
     "Hold ... where the robot starts"),
    "joints that only the robot knows": (
     lambda: JointPosture(np.zeros(7)).evaluate(here()), TaskError,
     "task 'posture': ... joints"),
    "a posture that only the start knows": (
     lambda: JointPosture(joints=["panda_joint1"]).evaluate(here()), TaskError,
     "task 'posture': ... reference"),
    "joint positions where the configuration is longer": (lambda: JointPosture(
        [0.0] * 3, joints=["joint1"]).measure(
        planar().state(0.0, planar().home(), np.zeros(3))),
     TaskError, "task 'posture': ... reference"),
}  # fmt: skip


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=wording(message)) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind


def test_names() -> None:
    assert FramePose("panda_tcp").name == "panda_tcp"
    assert FramePose().name == "end_effector"
    assert FrameOrientation("panda_tcp").name == "panda_tcp_orientation"
    assert Pointing("panda_tcp", TOOL).name == "panda_tcp_pointing"
    assert RelativePose("a", reference="b").name == "a_from_b"
    assert CenterOfMass().name == "center_of_mass"
    assert AngularMomentum().name == "angular_momentum"
    assert posture().name == "posture"
    assert posture(name="left-arm_2").name == "left-arm_2"
