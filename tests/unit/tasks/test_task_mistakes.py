"""Check that wrong arguments of tasks are refused by name, and how tasks are named."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from task_cases import TOOL, load, panda, placed, planar

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
from hsp_control.common.exceptions import (
    ConfigurationError,
    FrameNotFoundError,
    GainError,
    HspControlError,
    JointNotFoundError,
    ShapeError,
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
    "frame of a position": (
        lambda: placed(FramePosition("panda_tpc", POINT), panda()),
        FrameNotFoundError,
        r"^frame: no frame 'panda_tpc'; did you mean 'panda_tcp'\?",
    ),
    "frame of an orientation": (
        lambda: placed(FrameOrientation("hand", HOLD), panda()),
        FrameNotFoundError,
        r"^frame: no frame 'hand'; did you mean 'panda_hand'\?",
    ),
    "frame of a pose": (
        lambda: placed(FramePose("nowhere", POSE), panda()),
        FrameNotFoundError,
        r"^frame: no frame 'nowhere' \(the model has universe",
    ),
    "frame of a pointing": (
        lambda: placed(Pointing("panda_hnad", TOOL), panda()),
        FrameNotFoundError,
        r"^frame: .* did you mean 'panda_hand'",
    ),
    "frame of a relative pose": (
        lambda: placed(RelativePose("hand", reference="panda_link0"), panda()),
        FrameNotFoundError,
        r"^frame: no frame 'hand'",
    ),
    "reference of a relative pose": (
        lambda: placed(RelativePose(reference="panda_tpc"), panda()),
        FrameNotFoundError,
        r"^reference: no frame 'panda_tpc'; did you mean 'panda_tcp'\?",
    ),
    "a frame relative to itself": (
        lambda: placed(RelativePose(reference="panda_tcp"), panda()),
        TaskError,
        r"^reference: frame and reference are both 'panda_tcp'; they must be differ",
    ),
    "twice the same axis": (
        lambda: FramePosition("panda_tcp", Hold([0, 0]), axes="xx"),
        TaskError,
        r"^FramePosition: axes: 'xx' must be distinct letters of x, y and z$",
    ),
    "no axis": (
        lambda: CenterOfMass(Hold([0]), axes=""),
        TaskError,
        r"^CenterOfMass: axes: '' must be distinct letters",
    ),
    "another axis": (
        lambda: FramePosition("panda_tcp", Hold([0]), axes="u"),
        TaskError,
        r"^FramePosition: axes: 'u' must be distinct letters",
    ),
    "dimension of the trajectory": (
        lambda: placed(FramePosition("panda_tcp", Hold([0, 0])), panda()),
        TrajectoryError,
        r"^trajectory: point has 2 coordinates \[0.0, 0.0\]; needs 3$",
    ),
    "dimension of a path in Python": (
        lambda: placed(CenterOfMass(CallableTrajectory(np.sin, 2)), panda()),
        TaskError,
        r"^trajectory: the trajectory has dimension 2; the task needs 3$",
    ),
    "dimension of the momentum": (
        lambda: placed(AngularMomentum(Hold([0, 0])), panda()),
        TrajectoryError,
        r"^trajectory: point has 2 coordinates",
    ),
    "an orientation for a point": (
        lambda: FramePosition("panda_tcp", HOLD),  # type: ignore[arg-type]
        TaskError,
        r"^FramePosition: trajectory: a HoldOrientation is not one of the traj",
    ),
    "an orientation for a pose": (
        lambda: FramePose("panda_tcp", HOLD),  # type: ignore[arg-type]
        TaskError,
        r"^FramePose: trajectory: a HoldOrientation is not one of the poses or traj",
    ),
    "a blend into what begins where it says": (
        lambda: placed(FramePose("panda_tcp", POSE, blend=1.0), panda()),
        TaskError,
        r"^blend: HoldPose begins where it says; remove blend$",
    ),
    "more rows than dofs": (
        lambda: placed(FramePose("tip", POSE), planar()),
        TaskError,
        r"^the task has 6 rows; planar3r has 3 degrees of freedom$",
    ),
    "name": (
        lambda: FramePosition("panda_tcp", POINT, name="the hand"),
        TaskError,
        r"^FramePosition: task name 'the hand': use letters, digits, '_' and '-'",
    ),
    "parts of the largest error": (
        lambda: placed(FramePose("panda_tcp", POSE, largest_error=[0.1] * 3), panda()),
        TaskError,
        r"^largest_error: has 3 numbers; needs one for each part of the error: "
        r"position \[m\] and orientation \[rad\]$",
    ),
    "no direction": (
        lambda: Pointing("panda_tcp", [0, 0, 0]),
        TaskError,
        r"^Pointing: direction must be non-zero, got \[0, 0, 0\]$",
    ),
    "no axis to point with": (
        lambda: Pointing("panda_tcp", TOOL, axis=[0, 0, 0]),
        TaskError,
        r"^Pointing: axis must be non-zero, got \[0, 0, 0\]$",
    ),
    "direction of two numbers": (
        lambda: Pointing("panda_tcp", [1, 0]),
        TaskError,
        r"^Pointing: direction: \[1, 0\] has 2 entries, needs 3$",
    ),
    "infinite direction": (
        lambda: Pointing("panda_tcp", [1, 0, np.inf]),
        TaskError,
        r"^Pointing: direction.2: .inf is not a finite number$",
    ),
    "neither direction nor trajectory": (
        lambda: Pointing("panda_tcp"),
        TaskError,
        r"^Pointing: give one of direction and trajectory$",
    ),
    "both direction and trajectory": (
        lambda: Pointing("panda_tcp", TOOL, trajectory=HOLD),
        TaskError,
        r"^Pointing: give one of direction and trajectory$",
    ),
    "joint": (
        lambda: placed(posture(joints=["panda_joint8"]), panda()),
        JointNotFoundError,
        r"^joints: no joint 'panda_joint8'; did you mean 'panda_joint\d'\?",
    ),
    "root": (
        lambda: placed(posture(joints=["root_joint"]), load("ur5", "planar")),
        TaskError,
        r"^joints: joint 'root_joint' has 3 degrees of freedom; a posture task needs",
    ),
    "no joints": (
        lambda: placed(posture(joints=[]), panda()),
        TaskError,
        r"^joints: there is no joint$",
    ),
    "twice the same joint": (
        lambda: placed(posture(joints=["panda_joint1", "panda_joint1"]), panda()),
        TaskError,
        r"^joints: joint 'panda_joint1' is named twice$",
    ),
    "dimension of the displacement": (
        lambda: placed(posture(displacement=Hold([0.0, 0.0])), panda()),
        TrajectoryError,
        r"^displacement: point has 2 coordinates \[0.0, 0.0\]; needs 7$",
    ),
    "dimension of a displacement in Python": (
        lambda: placed(posture(displacement=CallableTrajectory(np.sin, 2)), panda()),
        TaskError,
        r"^displacement: the task has 7 joints; its displacement has dimension 2$",
    ),
    "shape of the reference": (
        lambda: placed(JointPosture([0.0] * 5), planar()),
        ShapeError,
        r"^reference: a posture has shape \(5,\); needs 3 or 6 numbers$",
    ),
    "no configuration": (
        lambda: placed(JointPosture([1.0, 0.0, 1.0, 0.0, 0.6, 0.7]), planar()),
        ConfigurationError,
        r"^reference: ",
    ),
    "gains of another size": (
        lambda: placed(FramePosition("panda_tcp", gains=Gains([1, 2], 1)), panda()),
        GainError,
        r"^gains: kp has shape \(2,\); needs a number, 3 numbers or a 3 × 3 matrix$",
    ),
    "gains without decay": (
        lambda: placed(CenterOfMass(gains=Gains(1 + 3 * np.ones((3, 3)), 1)), panda()),
        GainError,
        r"^gains: with these gains the error does not decay",
    ),
    "a frame that only the robot knows": (
        lambda: FramePosition(trajectory=POINT).evaluate(here()),
        TaskError,
        r"^task 'end_effector': a controller would look up its frame; outside of one,",
    ),
    "a frame that only the robot knows, in another's axes": (
        lambda: RelativePose(reference="panda_link0").evaluate(here()),
        TaskError,
        r"^task 'end_effector_from_panda_link0': a controller would look up its frame",
    ),
    "an orientation that only the start knows": (
        lambda: FramePose("panda_tcp", POINT).evaluate(here()),
        TaskError,
        r"^task 'panda_tcp': a controller would look up its orientation; outside of",
    ),
    "a point that only the start knows": (
        lambda: FramePosition("panda_tcp").evaluate(here()),
        TrajectoryError,
        r"^Hold is relative to where the robot starts, which only a controller knows",
    ),
    "joints that only the robot knows": (
        lambda: JointPosture(np.zeros(7)).evaluate(here()),
        TaskError,
        r"^task 'posture': a controller would look up its joints",
    ),
    "a posture that only the start knows": (
        lambda: JointPosture(joints=["panda_joint1"]).evaluate(here()),
        TaskError,
        r"^task 'posture': a controller would look up its reference",
    ),
    "joint positions where the configuration is longer": (
        lambda: JointPosture([0.0] * 3, joints=["joint1"]).measure(
            planar().state(0.0, planar().home(), np.zeros(3))
        ),
        TaskError,
        r"^task 'posture': a controller would look up its reference",
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
    assert FramePose("panda_tcp").name == "panda_tcp"
    assert FramePose().name == "end_effector"
    assert FrameOrientation("panda_tcp").name == "panda_tcp_orientation"
    assert Pointing("panda_tcp", TOOL).name == "panda_tcp_pointing"
    assert RelativePose("a", reference="b").name == "a_from_b"
    assert CenterOfMass().name == "center_of_mass"
    assert AngularMomentum().name == "angular_momentum"
    assert posture().name == "posture"
    assert posture(name="left-arm_2").name == "left-arm_2"


def test_arguments_are_copied() -> None:
    """Changing what was given in changes nothing."""
    robot = planar()
    reference, kp = robot.neutral(), np.array([1.0, 2.0, 3.0])
    task = placed(JointPosture(reference, gains=Gains(kp, 4.0)), robot)
    state = robot.state(0.0, robot.neutral(), np.zeros(3))
    reference[:] = robot.integrate(robot.neutral(), np.ones(3))
    kp[:] = 7.0
    np.testing.assert_array_equal(task.evaluate(state).error, 0.0)
    np.testing.assert_array_equal(task.feedback().Kp, np.diag([1.0, 2.0, 3.0]))


def test_a_task_is_named_after_its_frame_as_a_column_may_be() -> None:
    assert FramePosition("tip/1.0").name == "tip_1_0"
    assert RelativePose("tip/1", reference="tip/2").name == "tip_1_from_tip_2"
