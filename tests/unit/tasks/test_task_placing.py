"""Placing: omitted fields of a task are completed from the robot and its start."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pinocchio as pin
import pytest
from loaded_robots import load, panda
from task_cases import planar, single_joints
from wording import wording

from hsp_control import (
    CenterOfMass,
    Circle,
    Controller,
    FrameOrientation,
    FramePose,
    FramePosition,
    Gains,
    Hold,
    HspControlError,
    JointPosture,
    Line,
    Pointing,
    Robot,
    RobotState,
    Task,
)
from hsp_control.common.errors import (
    FrameNotFoundError,
    GainError,
    JointNotFoundError,
    ShapeError,
    TaskError,
    TrajectoryError,
)
from hsp_control.geometry import Scene
from hsp_control.geometry.scene import Start
from hsp_control.law import TaskSample
from hsp_control.tasks import AngularMomentum, RelativePose
from hsp_control.trajectories import (
    Blend,
    BlendOrientation,
    ComposedPose,
    HoldOrientation,
    HoldPose,
    ScrewInterpolation,
    Spin,
    UniformLine,
)

TCP = "panda_tcp"
POINT = np.array([0.4, 0.1, 0.5])
TURNED = pin.exp3(np.array([0.3, -0.5, 0.4]))


def state(robot: Robot | None = None, seed: int = 4) -> RobotState:
    """Return a state in motion, away from home."""
    robot, rng = panda() if robot is None else robot, np.random.default_rng(seed)
    q = robot.random_configuration(rng)
    return robot.state(0.0, q, rng.standard_normal(robot.nv))


def place(task: Any, at: RobotState | None = None) -> Any:
    return task.placed(Start(state() if at is None else at, Scene()))


def pose_of(at: RobotState, frame: str) -> pin.SE3:
    kinematics = at.frame(frame)
    return pin.SE3(kinematics.rotation.copy(), kinematics.position.copy())


def seen(at: RobotState, frame: str, reference: str) -> pin.SE3:
    return pose_of(at, reference).actInv(pose_of(at, frame))


TASKS: dict[str, Task] = {
    "momentum": AngularMomentum(),
    "momentum, relative": AngularMomentum(Circle(0.1, 2.0)),
    "mass": CenterOfMass(),
    "mass on axes": CenterOfMass(Circle(0.1, 2.0), axes="zx", blend=1.0),
    "orientation": FrameOrientation(),
    "orientation, blended": FrameOrientation(TCP, Spin([0, 0, 1], 0.5), blend=1.0),
    "pose": FramePose(),
    "pose of a point": FramePose(TCP, Circle(0.1, 2.0), blend=1.5),
    "pose of a screw": FramePose(trajectory=ScrewInterpolation(POINT, TURNED, 1.0)),
    "pose in the world": FramePose("panda_hand", HoldPose(POINT, TURNED)),
    "position": FramePosition(),
    "position on axes": FramePosition(axes="y", trajectory=Line([0.3], 2.0)),
    "position in the world": FramePosition("panda_hand", Circle(0.1, 2, POINT)),
    "posture": JointPosture(),
    "some joints": JointPosture(
        np.linspace(-1, 1, 7), joints=["panda_joint4", "panda_joint2"],
        displacement=Circle(0.1, 1.0, [0.0, 0.1]),
    ),
    "pointing": Pointing(direction=[0, 0.6, 0.8]),
    "pointing, turning": Pointing(trajectory=Spin([0, 1, 0], 0.5), axis=[1, 0, 0]),
    "relative": RelativePose(reference="panda_link2"),
    "relative, blended": RelativePose(
        reference="panda_link2", trajectory=Line([0.1, 0.2, 0.3], 1.0), blend=1.0
    ),
}  # fmt: skip


@pytest.mark.parametrize(
    "name",
    ["mass", "orientation", "pose", "position", "posture", "relative", "mass on axes",
     "orientation, blended", "pose of a point", "pose of a screw", "position on axes",
     "pointing, turning", "relative, blended"],
)  # fmt: skip
def test_omitted_targets_are_at_the_robot_s_start(name: str) -> None:
    """The error is zero there, or the circle's radius before its blend."""
    here = state()
    placed = place(TASKS[name], here)
    error = placed.evaluate(here).error
    assert error.shape == (placed.rows,)
    np.testing.assert_allclose(error, 0.0, rtol=0, atol=1e-14)


def test_relative_points_are_relative_to_the_start() -> None:
    here = state()
    x = here.position(TCP).copy()
    level = place(FramePosition(trajectory=Circle(0.1, 2.0)), here)
    assert level.trajectory == Circle(0.1, 2.0, x)
    moved = Circle(0.1, 2.0, [0.1, 0.2, 0.3], origin="start")
    assert place(FramePosition(trajectory=moved), here).trajectory == Circle(
        0.1, 2.0, x + moved.center
    )
    line = Line([0.0, 0.0, 0.1], 1.0, origin="start")
    assert place(FramePosition(trajectory=line), here).trajectory == Line(
        x + line.end, 1.0, start=x
    )
    on_axes = place(FramePosition(trajectory=UniformLine([1, 2]), axes="zx"), here)
    assert on_axes.trajectory == UniformLine([1, 2], x[[2, 0]])
    world = FramePosition(trajectory=Hold(POINT))
    assert place(world, here).trajectory == Hold(POINT)
    c = here.centroidal.position.copy()
    assert place(CenterOfMass(axes="yx"), here).trajectory == Hold(c[[1, 0]])
    assert place(AngularMomentum(), here).trajectory == Hold([0.0, 0.0, 0.0])
    about_zero = place(AngularMomentum(Circle(1, 2)), here).trajectory
    assert about_zero == Circle(1, 2, [0, 0, 0])


def test_a_point_trajectory_of_a_pose_holds_the_orientation() -> None:
    here = state()
    pose = pose_of(here, TCP)
    x, R = pose.translation, pose.rotation
    circle = Circle(0.1, 2.0)
    expected = ComposedPose(Circle(0.1, 2.0, x), HoldOrientation(R))
    assert place(FramePose(trajectory=circle), here).trajectory == expected
    world = Circle(0.1, 2.0, POINT)
    placed = place(FramePose(trajectory=world), here)
    assert placed.trajectory == ComposedPose(world, HoldOrientation(R))
    # The same as with a pose; for a relative pose, in the reference's axes.
    reported = FramePose(trajectory=ComposedPose(position=world))
    assert place(reported, here) == placed
    relative = seen(here, TCP, "panda_link2")
    placed = place(RelativePose(reference="panda_link2", trajectory=circle), here)
    assert placed.trajectory == ComposedPose(
        Circle(0.1, 2.0, relative.translation), HoldOrientation(relative.rotation)
    )
    # Its six rows obey the same equation as those of the composed pose.
    for t in (0.0, 0.4):
        at = panda().state(t, here.q, here.v)
        sample = placed.evaluate(at)
        R_d = relative.rotation
        R_now = seen(at, TCP, "panda_link2").rotation
        np.testing.assert_allclose(
            sample.error[3:], -pin.log3(R_d.T @ R_now), rtol=0, atol=1e-13
        )


@pytest.mark.parametrize("robot", ["panda", "planar3r"])
def test_a_blend_leads_from_rest_at_the_start_into_the_trajectory(robot: str) -> None:
    here = state(load(robot))
    frame = here.robot.end_effector
    x, R = (getattr(pose_of(here, frame), n) for n in ("translation", "rotation"))
    path, turn = (
        Circle(0.2, 2.0, [0.5, 0.2, 0.1]),
        Spin([0, 0, 1], 0.7, rotation=TURNED),
    )
    cases: list[tuple[Any, Any]] = [
        (FramePosition(trajectory=path, blend=0.5), Blend(path, 0.5, start=x)),
        (
            FramePosition(trajectory=Circle(0.2, 2.0), blend=0.5),
            Blend(Circle(0.2, 2.0, x), 0.5, start=x),
        ),
        (
            FrameOrientation(trajectory=turn, blend=0.5),
            BlendOrientation(turn, 0.5, rotation=R),
        ),
        (
            CenterOfMass(path, blend=0.5),
            Blend(path, 0.5, start=here.centroidal.position),
        ),
    ]
    if robot == "panda":
        cases += [
            (
                FramePose(trajectory=ComposedPose(path, turn), blend=0.5),
                ComposedPose(
                    Blend(path, 0.5, start=x), BlendOrientation(turn, 0.5, rotation=R)
                ),
            ),
            (
                FramePose(trajectory=path, blend=0.5),
                ComposedPose(
                    Blend(path, 0.5, start=x),
                    BlendOrientation(HoldOrientation(R), 0.5, rotation=R),
                ),
            ),
        ]
    for task, expected in cases:
        placed = place(task, here)
        assert placed.trajectory == expected
        start, later = placed.trajectory.sample(0.0), placed.trajectory.sample(0.6)
        if isinstance(expected, Blend):
            for rate in start[1:]:
                np.testing.assert_array_equal(rate, 0.0)
            own = expected.trajectory.sample(0.6)
            for mine, other in zip(later, own, strict=True):
                np.testing.assert_array_equal(mine, other)
        at_rest = here.robot.state(0.0, here.q, np.zeros(here.robot.nv))
        sample = placed.evaluate(at_rest)
        np.testing.assert_allclose(sample.error, 0.0, rtol=0, atol=1e-14)
        np.testing.assert_allclose(sample.error_rate, 0.0, rtol=0, atol=1e-14)


# --- postures ------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("name", "root"), [("panda", None), ("planar3r", None), ("ur5", "planar")]
)
def test_postures_are_given_in_four_ways(name: str, root: Any) -> None:
    robot = load(name, root)
    here = state(robot)
    positions = np.linspace(-0.5, 0.5, robot.nv)
    for reference, expected in (
        ("start", here.q),
        ("home", robot.home()),
        (positions, robot.integrate(robot.neutral(), positions)),
        (robot.home(), robot.home()),
    ):
        placed = place(JointPosture(reference), here)
        np.testing.assert_array_equal(placed.reference, expected)
        assert placed.joints == tuple(single_joints(robot))
        assert placed.rows == len(single_joints(robot))
        assert not placed.reference.flags.writeable
    assert place(JointPosture(), here) == place(JointPosture("start"), here)
    np.testing.assert_allclose(
        place(JointPosture(), here).evaluate(here).error, 0.0, rtol=0, atol=1e-14
    )


# --- by a controller -----------------------------------------------------------------


def test_the_first_state_is_the_start_unless_one_is_given() -> None:
    """Before that the robot's home replaces it; `restart` begins anew."""
    robot, first, second = panda(), state(seed=1), state(seed=2)
    at_home = robot.state(0.0, robot.home(), np.zeros(7))
    free = Controller(robot, [FramePosition()])
    assert free.tasks == (place(FramePosition(), at_home),)
    for here in (first, second):
        free.compute(here.t, here.q, here.v)
        assert free.tasks == (place(FramePosition(), first),)
    free.restart()
    free.compute(second.t, second.q, second.v)
    assert free.tasks == (place(FramePosition(), second),)

    given = Controller(robot, [FramePosition()], start=first.q)
    for _ in range(2):
        assert given.tasks == (place(FramePosition(), first),)
        given.compute(second.t, second.q, second.v)
        assert given.tasks == (place(FramePosition(), first),)
        given.restart()


MISTAKES: dict[str, tuple[Callable[[], Task], type[HspControlError], str]] = {
    "frame": (lambda: FramePose("panda_tpc", name="hand"), FrameNotFoundError,
     "tasks.hand.frame: no ... 'panda_tpc' ... 'panda_tcp'"),
    "trajectory": (lambda: FramePosition(trajectory=Hold([0, 0]), name="hand"),
     TrajectoryError,
     "tasks.hand.trajectory: ... [0.0, 0.0] ... 3"),
    "blend": (
     lambda: FramePose(trajectory=HoldPose(POINT, TURNED), blend=1.0, name="hand"),
     TaskError, "tasks.hand.blend: HoldPose ... blend"),
    "gains": (lambda: FramePosition(gains=Gains([1, 2], 3), name="hand"), GainError,
     "tasks.hand.gains: kp ... (2,) ... 3 × 3"),
    "joints": (lambda: JointPosture(joints=["joint1"], name="hand"),
     JointNotFoundError, "tasks.hand.joints: no joint 'joint1'"),
    "reference": (lambda: JointPosture([0.0] * 6, name="hand"), ShapeError,
     "tasks.hand.reference: a posture ... (6,) ... 7 numbers"),
    "displacement": (lambda: JointPosture(displacement=Hold([0.0]), name="hand"),
     TrajectoryError,
     "tasks.hand.displacement: ... [0.0] ... 7"),
}  # fmt: skip


@pytest.mark.parametrize("which", MISTAKES)
def test_the_message_has_the_key_path(which: str) -> None:
    make, kind, message = MISTAKES[which]
    with pytest.raises(kind, match=wording(message)) as raised:
        Controller(panda(), [FramePosition(axes="x"), make()])
    assert type(raised.value) is kind
    running = Controller(panda(), [FramePosition(axes="x")])
    with pytest.raises(kind, match=wording(message.replace("tasks.hand", "task", 1))):
        running.at(1.0).add(make())
    assert running.changes == ()


def test_too_many_rows_are_reported_with_the_robot() -> None:
    with pytest.raises(TaskError, match=r"^tasks.hand: the task has 6 rows; planar3r"):
        Controller(planar(), [FramePose(name="hand")])


# --- user-defined tasks --------------------------------------------------------------


class Doubled(FramePosition):
    """A user's task that overrides `evaluate` and calls the base class's."""

    def evaluate(
        self, state: RobotState, out: TaskSample | None = None, feedback: Any = None
    ) -> TaskSample:
        out = super().evaluate(state, out, feedback)
        for array in out:
            array *= 2.0
        return out


def test_a_subclass_may_call_the_evaluate_that_it_overrides() -> None:
    """Equal to its base class at the same state, and in a controller."""
    here = state()
    plain, doubled = (
        place(FramePosition(TCP, Hold(POINT))),
        place(Doubled(TCP, Hold(POINT))),
    )
    for _ in range(2):
        a = plain.evaluate(here).acceleration
        np.testing.assert_array_equal(doubled.evaluate(here).acceleration, 2.0 * a)
    out = Controller(panda(), [doubled]).compute(here.t, here.q, here.v)
    np.testing.assert_array_equal(out.task.acceleration, 2.0 * a)
