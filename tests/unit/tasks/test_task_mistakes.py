"""Check that wrong arguments of tasks are refused by name, and how tasks are named."""

from collections.abc import Callable
from typing import Any

import numpy as np
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
    return JointPosture(robot.neutral(), gains=GAINS, **options)


def pose(robot: Robot, frame: str) -> FramePose:
    return FramePose(frame, HoldPose(np.zeros(3), np.eye(3)), gains=GAINS)


HOLD = HoldOrientation(np.eye(3))
ERRORS: dict[str, tuple[Callable[[], Any], type[HspControlError], str]] = {
    "frame of a position": (
        lambda: FramePosition("panda_tpc", Hold([0, 0, 0]), gains=GAINS),
        FrameNotFoundError,
        r"no frame 'panda_tpc'; did you mean 'panda_tcp'\?",
    ),
    "frame of an orientation": (
        lambda: FrameOrientation("hand", HOLD, gains=GAINS),
        FrameNotFoundError,
        r"^no frame 'hand'; did you mean 'panda_hand'\?",
    ),
    "frame of a pose": (
        lambda: pose(panda(), "nowhere"),
        FrameNotFoundError,
        r"^no frame 'nowhere' \(the model has universe",
    ),
    "frame of a pointing": (
        lambda: Pointing("panda_hnad", axis=TOOL, trajectory=HOLD, gains=GAINS),
        FrameNotFoundError,
        r"did you mean 'panda_hand'",
    ),
    "twice the same axis": (
        lambda: FramePosition("panda_tcp", Hold([0, 0]), gains=GAINS, axes="xx"),
        TaskError,
        r"^axes 'xx': must be distinct letters of x, y and z$",
    ),
    "no axis": (
        lambda: FramePosition("panda_tcp", Hold([0]), gains=GAINS, axes=""),
        TaskError,
        r"^axes '': must be distinct letters",
    ),
    "another axis": (
        lambda: FramePosition("panda_tcp", Hold([0]), gains=GAINS, axes=["u"]),
        TaskError,
        r"^axes 'u': must be distinct letters",
    ),
    "dimension of the trajectory": (
        lambda: FramePosition("panda_tcp", Hold([0, 0]), gains=GAINS),
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
        lambda: FramePosition("panda_tcp", Hold([0, 0, 0]), gains=GAINS, name="the hand"),
        TaskError,
        r"^task name 'the hand': use letters, digits, '_' and '-'",
    ),
    "no direction": (
        lambda: Pointing("panda_tcp", axis=[0, 0, 0], trajectory=HOLD, gains=GAINS),
        TaskError,
        r"^axis must be 3 finite numbers, not all zero; got \[0, 0, 0\]$",
    ),
    "direction of two numbers": (
        lambda: Pointing("panda_tcp", axis=[1, 0], trajectory=HOLD, gains=GAINS),
        TaskError,
        r"^axis must be 3 finite numbers, not all zero; got \[1, 0\]",
    ),
    "infinite direction": (
        lambda: Pointing("panda_tcp", axis=[1, 0, np.inf], trajectory=HOLD, gains=GAINS),
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
        lambda: JointPosture([0.0, 0.0, 0.0], gains=GAINS),
        ShapeError,
        r"^configuration q has shape \(3,\); planar3r needs \(6,\) \(nq = 6, nv = 3\)$",
    ),
    "gains of another size": (
        lambda: FramePosition("panda_tcp", Hold([0, 0, 0]), gains=Gains([1, 2], 1)),
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
    assert FrameOrientation("panda_tcp", HOLD, gains=GAINS).name == (
        "panda_tcp_orientation"
    )
    assert Pointing("panda_tcp", axis=TOOL, trajectory=HOLD, gains=GAINS).name == "panda_tcp_pointing"
    assert posture(robot).name == "posture"
    assert posture(robot, name="left-arm_2").name == "left-arm_2"
    assert posture(load("ur5", "planar")).joints == tuple(
        single_joints(load("ur5", "planar"))
    )


def test_arguments_are_copied() -> None:
    """Changing what was given in changes nothing."""
    robot = planar()
    reference, kp = robot.neutral(), np.array([1.0, 2.0, 3.0])
    task = JointPosture(reference, gains=Gains(kp, 4.0))
    state = robot.state(0.0, robot.neutral(), np.zeros(3))
    reference[:] = robot.integrate(robot.neutral(), np.ones(3))
    kp[:] = 7.0
    np.testing.assert_array_equal(task.evaluate(state).error, 0.0)
    np.testing.assert_array_equal(task.Kp, np.diag([1.0, 2.0, 3.0]))


def test_a_task_is_named_after_its_frame_as_a_column_may_be() -> None:
    frames = {"tip/1.0": ToolFrame("panda_hand")}
    robot = Robot.load("panda", tool_frames=frames)
    task = FramePosition("tip/1.0", Hold([0.4, 0, 0.4]), gains=Gains(1, 1))
    assert task.name == "tip_1_0"
