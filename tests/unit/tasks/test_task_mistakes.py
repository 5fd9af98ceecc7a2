"""Check that wrong arguments of tasks are refused by name, and how tasks are named."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from task_cases import GAINS, TOOL, load, panda, planar, single_joints

from hsp_control import (
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    JointPosture,
    Pointing,
    Robot,
    ToolFrame,
)
from hsp_control.common.exceptions import (
    FrameNotFoundError,
    GainError,
    HspControlError,
    JointNotFoundError,
    ShapeError,
    TaskError,
)
from hsp_control.trajectories import (
    HoldOrientation,
    HoldPose,
)

pytestmark = pytest.mark.filterwarnings("error")


def posture(robot: Robot, **options: Any) -> JointPosture:
    return JointPosture(robot, robot.neutral(), GAINS, **options)


def pose(robot: Robot, frame: str) -> FramePose:
    return FramePose(robot, frame, HoldPose(pin.SE3.Identity()), GAINS)


HOLD = HoldOrientation(np.eye(3))
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    "frame of a position": (
        lambda: FramePosition(panda(), "panda_tpc", Hold([0, 0, 0]), GAINS),
        FrameNotFoundError,
        r"no frame 'panda_tpc'; did you mean 'panda_tcp'\?",
    ),
    "frame of an orientation": (
        lambda: FrameOrientation(panda(), "hand", HOLD, GAINS),
        FrameNotFoundError,
        r"^no frame 'hand'; did you mean 'panda_hand'\?",
    ),
    "frame of a pose": (
        lambda: pose(panda(), "nowhere"),
        FrameNotFoundError,
        r"^no frame 'nowhere' \(the model has universe",
    ),
    "frame of a pointing": (
        lambda: Pointing(panda(), "panda_hnad", TOOL, HOLD, GAINS),
        FrameNotFoundError,
        r"did you mean 'panda_hand'",
    ),
    "twice the same axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0]), GAINS, axes="xx"),
        TaskError,
        r"^axes 'xx': must be distinct letters of x, y and z$",
    ),
    "no axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0]), GAINS, axes=""),
        TaskError,
        r"^axes '': must be distinct letters",
    ),
    "another axis": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0]), GAINS, axes=["u"]),
        TaskError,
        r"^axes 'u': must be distinct letters",
    ),
    "dimension of the trajectory": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0]), GAINS),
        TaskError,
        r"^task 'panda_tcp' tracks the axes 'xyz'; its trajectory has dimension 2, "
        r"needs 3$",
    ),
    "more rows than dofs": (
        lambda: pose(planar(), "tip"),
        TaskError,
        r"^task 'tip' has 6 rows; planar3r has 3 degrees of freedom$",
    ),
    "name": (
        lambda: FramePosition(
            panda(), "panda_tcp", Hold([0, 0, 0]), GAINS, name="the hand"
        ),
        TaskError,
        r"^task name 'the hand': use letters, digits, '_' and '-'",
    ),
    "no direction": (
        lambda: Pointing(panda(), "panda_tcp", [0, 0, 0], HOLD, GAINS),
        TaskError,
        r"^axis must be 3 finite numbers, not all zero; got \[0, 0, 0\]$",
    ),
    "direction of two numbers": (
        lambda: Pointing(panda(), "panda_tcp", [1, 0], HOLD, GAINS),
        TaskError,
        r"^axis must be 3 finite numbers, not all zero; got \[1, 0\]",
    ),
    "infinite direction": (
        lambda: Pointing(panda(), "panda_tcp", [1, 0, np.inf], HOLD, GAINS),
        TaskError,
        r"^axis must be 3 finite numbers, not all zero",
    ),
    "joint": (
        lambda: posture(panda(), joints=["panda_joint8"]),
        JointNotFoundError,
        r"^no joint 'panda_joint8'; did you mean 'panda_joint\d'\?",
    ),
    "root": (
        lambda: posture(load("ur5", "planar"), joints=["root_joint"]),
        TaskError,
        r"^joint 'root_joint' has 3 degrees of freedom; a posture task needs joints",
    ),
    "no joints": (
        lambda: posture(panda(), joints=[]),
        TaskError,
        r"^task 'posture' names no joint$",
    ),
    "twice the same joint": (
        lambda: posture(panda(), joints=["panda_joint1", "panda_joint1"]),
        TaskError,
        r"^task 'posture' names joint 'panda_joint1' twice$",
    ),
    "dimension of the displacement": (
        lambda: posture(panda(), displacement=Hold([0.0, 0.0])),
        TaskError,
        r"^task 'posture' has 7 joints; its displacement has dimension 2$",
    ),
    "shape of the reference": (
        lambda: JointPosture(planar(), [0.0, 0.0, 0.0], GAINS),
        ShapeError,
        r"^configuration q has shape \(3,\); planar3r needs \(6,\) \(nq = 6, nv = 3\)$",
    ),
    "gains of another size": (
        lambda: FramePosition(panda(), "panda_tcp", Hold([0, 0, 0]), Gains([1, 2], 1)),
        GainError,
        r"^kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
}


@pytest.mark.parametrize("which", ERRORS)
def test_errors(which: str) -> None:
    build, kind, message = ERRORS[which]
    with pytest.raises(kind, match=message) as caught:
        build()
    assert isinstance(caught.value, HspControlError)
    assert type(caught.value) is kind


def test_names() -> None:
    robot = panda()
    assert pose(robot, "panda_tcp").name == "panda_tcp"
    assert FrameOrientation(robot, "panda_tcp", HOLD, GAINS).name == (
        "panda_tcp_orientation"
    )
    assert Pointing(robot, "panda_tcp", TOOL, HOLD, GAINS).name == "panda_tcp_pointing"
    assert posture(robot).name == "posture"
    assert posture(robot, name="left-arm_2").name == "left-arm_2"
    assert posture(load("ur5", "planar")).joints == tuple(
        single_joints(load("ur5", "planar"))
    )


def test_arguments_are_copied() -> None:
    """Changing what was given in changes nothing."""
    robot = planar()
    reference, kp = robot.neutral(), np.array([1.0, 2.0, 3.0])
    task = JointPosture(robot, reference, Gains(kp, 4.0))
    state = robot.state(0.0, robot.neutral(), np.zeros(3))
    reference[:] = robot.integrate(robot.neutral(), np.ones(3))
    kp[:] = 7.0
    np.testing.assert_array_equal(task.evaluate(state).error, 0.0)
    np.testing.assert_array_equal(task.Kp, np.diag([1.0, 2.0, 3.0]))


def test_a_task_is_named_after_its_frame_as_a_column_may_be() -> None:
    frames = {"tip/1.0": ToolFrame("panda_hand")}
    robot = Robot.load("panda", tool_frames=frames)
    task = FramePosition(robot, "tip/1.0", Hold([0.4, 0, 0.4]), Gains(1, 1))
    assert task.name == "tip_1_0"
